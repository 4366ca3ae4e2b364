//! The page, and the meshes it asks for.

use std::sync::Arc;
use std::time::Instant;

use super::http::{Request, Response, Status};
use super::mesh_message::encode_mesh;
use super::pose_request::PoseRequest;
use super::server::Answer;
use crate::avatar::Animator;
use crate::body::Pose;
use crate::export::RiggedMesh;
use crate::report::live_page;
use crate::{Error, Result};

/// Most cells along the longest side of a mesh that a browser gets.
pub const LARGEST_RESOLUTION: usize = 256;
const MESH: &str = "/mesh";

/// What one `xavatar view` serves.
pub struct Site<'a> {
    page: Arc<[u8]>,
    policy: String,
    /// None without a body model.
    animator: Option<&'a Animator<'a>>,
}

impl<'a> Site<'a> {
    /// The site of an avatar: its rig moves in the browser, `animator` makes the field's own meshes, if it is there.
    ///
    /// # Errors
    /// [`InputError::Value`](crate::InputError::Value) for a rig that the page cannot draw.
    pub fn new(title: String, lead: String, rig: &RiggedMesh, animator: Option<&'a Animator<'a>>) -> Result<Self> {
        let (page, policy) = live_page(title, lead, rig, animator.map(|_| MESH))?;
        Ok(Self { page: page.into_bytes().into(), policy, animator })
    }

    fn page(&self) -> Response {
        let policy = ("Content-Security-Policy", format!("{}; frame-ancestors 'none'", self.policy));
        Response {
            status: Status::Ok,
            content_type: "text/html; charset=utf-8",
            fields: vec![policy],
            body: self.page.clone(),
        }
    }

    /// What poses the asked-for pose, or why it is not posed.
    fn pose(&self, request: &Request) -> std::result::Result<(&'a Animator<'a>, Pose, usize), Response> {
        let refuse = |status, text: &str| Err(Response::text(status, text));
        let Some(animator) = self.animator else {
            return refuse(Status::NotFound, "no body model to pose with: start the server with one");
        };
        // A foreign page cannot send this type without asking first, which is never granted.
        let content_type = request.field("content-type").unwrap_or_default();
        if !content_type.split(';').next().unwrap_or_default().trim().eq_ignore_ascii_case("application/json") {
            return refuse(Status::UnsupportedMediaType, "expected Content-Type: application/json");
        }
        let wanted = PoseRequest::parse(&request.body);
        let wanted = wanted.and_then(|wanted| Ok((wanted.pose(&animator.avatar().subject)?, wanted.resolution)));
        let posable = wanted.map(|(pose, resolution)| (animator, pose, resolution));
        posable.map_err(|error| Response::text(Status::UnprocessableContent, error))
    }

    fn mesh(&self, request: &Request) -> Response {
        let (animator, pose, resolution) = match self.pose(request) {
            Ok(posable) => posable,
            Err(refused) => return refused,
        };
        let begin = Instant::now();
        match animator.extract(&pose, resolution) {
            Ok(extraction) => Response {
                status: Status::Ok,
                content_type: "application/octet-stream",
                fields: Vec::new(),
                body: encode_mesh(&extraction.mesh, resolution, begin.elapsed().as_secs_f32()).into(),
            },
            Err(error @ Error::NoSurface { .. }) => Response::text(Status::UnprocessableContent, error),
            Err(error) => Response::text(Status::InternalServerError, error),
        }
    }
}

impl Answer for Site<'_> {
    fn answer(&self, request: &Request) -> Response {
        match (request.path.as_str(), request.method.as_str()) {
            ("/", "GET" | "HEAD") => self.page(),
            (MESH, "POST") => self.mesh(request),
            ("/", _) => not_allowed("GET, HEAD"),
            (MESH, _) => not_allowed("POST"),
            _ => Response::text(Status::NotFound, "nothing is here"),
        }
    }

    /// Poses do: an extraction uses all threads.
    fn takes_long(&self, request: &Request) -> bool {
        request.path == MESH && request.method == "POST" && self.pose(request).is_ok()
    }
}

pub(super) fn not_allowed(methods: &str) -> Response {
    let mut response = Response::text(Status::MethodNotAllowed, format_args!("expected {methods}"));
    response.fields.push(("Allow", methods.into()));
    response
}
