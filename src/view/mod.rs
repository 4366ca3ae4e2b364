//! `xavatar view`: a small server for one's own browser, which sends poses and gets the avatar's own mesh.
//!
//! `GET /` is the page, `POST /mesh` takes SMPL-X parameters as JSON and answers with the surface that
//! [`Animator::extract`](crate::avatar::Animator::extract) finds for them (docs/report.md). Whatever a client sends, it gets an
//! answer, most often a 4xx, within seconds; clients do not wait for each other except for the processor.

mod http;
mod mesh_message;
mod origin;
mod pose_request;
mod server;
mod site;

pub use http::{Request, Response, Status};
pub use mesh_message::decode_mesh;
pub use server::{Answer, Server, Stop};
pub use site::{LARGEST_RESOLUTION, Site};
