//! Training that can be looked at in the browser while it goes on.

use std::sync::atomic::AtomicBool;

use xavatar::body::BodyModel;
use xavatar::runs::{Ending, Event, Observer, Run};
use xavatar::view::{Server, TrainingSite};

use crate::cli::output::progress::Progress;
use crate::cli::output::report;

/// Trains, and serves the page of the run on a port of this machine until that ends.
pub fn train(
    run: &Run,
    body: &BodyModel,
    port: u16,
    stop: &AtomicBool,
    progress: &mut Progress,
) -> anyhow::Result<Ending> {
    let server = Server::bind("127.0.0.1", port)?;
    log::info!("the page: http://{}/", server.address());
    let site = TrainingSite::new(run.folder(), body, report::title(run.folder()), report::command_line());
    let end = server.stop();
    std::thread::scope(|scope| {
        scope.spawn(|| site.make_pages());
        scope.spawn(|| server.run(&site));
        let ending = run.train(stop, &mut Watched { site: &site, progress });
        site.end();
        end.stop();
        Ok(ending?)
    })
}

/// Tells the terminal, and gives the page what it wants.
struct Watched<'a> {
    site: &'a TrainingSite<'a>,
    progress: &'a mut Progress,
}

impl Observer for Watched<'_> {
    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::Avatar { avatar } => self.site.give(*avatar),
            event => self.progress.event(event),
        }
    }

    fn wants_avatar(&mut self) -> bool {
        self.site.wants_avatar()
    }
}
