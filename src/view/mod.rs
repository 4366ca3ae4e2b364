//! `xavatar view`: a small server for one's own browser, which sends poses and gets the avatar's own mesh.
//!
//! `GET /` is the page, `POST /mesh` takes a pose, rotations by the names of joints, as JSON and answers with the surface that
//! [`Animator::extract`](crate::avatar::Animator::extract) finds for them (docs/report.md). Whatever a client sends, it gets an
//! answer, most often a 4xx, within seconds. Clients wait for each other only for poses, of which one is computed at a time: for each
//! client that is still there its latest.

mod connection;
mod http;
mod mesh_message;
mod origin;
mod pose_request;
mod server;
mod site;
mod training;
mod waiting;

pub use http::{Request, Response, Status};
pub use mesh_message::decode_mesh;
pub use pose_request::PoseRequest;
pub use server::{Answer, Server, Stop};
pub use site::{LARGEST_RESOLUTION, Site};
pub use training::TrainingSite;
