//! `xavatar view`: an avatar in the browser, live.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use xavatar::avatar::{Animator, Avatar};
use xavatar::report::viewer_rig;
use xavatar::view::{Server, Site};

use crate::cli::Outcome;
use crate::cli::options::inputs::{built_in_body, load_body};
use crate::cli::options::motion::MotionArguments;
use crate::cli::output::{files, report};

/// Play with an avatar in the browser
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    xavatar view runs/demo\n  \
    xavatar view runs/00016 --body models/smplx\n  \
    xavatar view avatar.safetensors --body models/smplx --motion walk.bvh --port 9000\n\n\
    The page has sliders for joints, jaw and expressions. A skinned mesh moves; with a body model the surface of a pose\n\
    that rests comes from the avatar's own fields. Ctrl-C ends it, twice without waiting for the frame under way.")]
pub struct View {
    /// An avatar.safetensors or a run's folder
    #[arg(value_name = "AVATAR")]
    avatar: PathBuf,
    /// Body model file of any family, or a folder that holds SMPLX_{GENDER}.npz or .pkl; the demo's avatar needs none
    #[arg(long, value_name = "BODY")]
    body: Option<PathBuf>,
    /// The motion that the page plays: any that `animate` takes
    #[arg(long, value_name = "MOTION", default_value = xavatar::synthetic::DANCE)]
    motion: PathBuf,
    /// Port to listen on; 0 for any that is free
    #[arg(long, value_name = "PORT", default_value_t = 8383)]
    port: u16,
    /// Address or name to listen on. The default is reached from this machine alone; 0.0.0.0 lets everyone in the network in
    #[arg(long, value_name = "HOST", default_value = "127.0.0.1")]
    host: String,
    #[command(flatten)]
    options: MotionArguments,
}

impl View {
    pub fn run(self) -> anyhow::Result<Outcome> {
        let avatar = Avatar::load(&self.avatar)?;
        let body = match &self.body {
            Some(body) => Some(load_body(body, avatar.subject.gender)?),
            None => built_in_body(&avatar)?,
        };
        let of_body = body.as_ref().map(|(body, _)| body);
        let clip = self.options.load(&self.motion, &avatar, of_body)?;
        // A port that is taken is known before the work.
        let server = Server::bind(&self.host, self.port)?;
        log::info!("preparing the avatar");
        let rig = viewer_rig(&avatar, of_body, &clip.poses, clip.frames_per_second)?;
        let animator = match &body {
            Some((body, labels)) => Some(Animator::new(&avatar, body, labels)?),
            None => None,
        };
        let lead = match animator {
            Some(_) => "In motion a skinned mesh; at rest the surface that the avatar's fields have for the pose.",
            None => "Skinned in the browser. Start with --body to see the field's own surface in every pose.",
        };
        let site = Site::new(report::title(&self.avatar), lead.into(), &rig, animator.as_ref())?;
        let (stop, interrupted) = (server.stop(), AtomicBool::new(false));
        ctrlc::set_handler(move || {
            if interrupted.swap(true, Ordering::SeqCst) {
                std::process::exit(crate::cli::EXIT_FAILED.into());
            }
            stop.stop();
        })?;
        let address = server.address();
        if !address.ip().is_loopback() {
            log::warn!("everyone who reaches {address} can use this avatar; without --host only this machine does");
        }
        files::print(&format!("http://{address}/\n"))?;
        log::info!("open this page in a browser; Ctrl-C ends it");
        server.run(&site);
        Ok(Outcome::Done)
    }
}
