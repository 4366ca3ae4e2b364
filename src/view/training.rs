//! The page of a run that goes on: losses, previews, and the avatar as it is, to be turned around.
//!
//! Training comes first. A page is made only when somebody has asked since the last one, by one thread, and after a page that took t
//! seconds none is begun for [`REST`] times as long: of one core's time at most a fiftieth, of all cores' less. Until the next, everybody
//! gets the last.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::http::{Request, Response, Status};
use super::server::Answer;
use super::site::not_allowed;
use crate::avatar::Avatar;
use crate::body::BodyModel;
use crate::report::{Report, machine, quick_dancing_rig};
use crate::{Error, InputError, Result};

/// How long to wait after a page, in times that it took to make.
const REST: u32 = 50;
/// How often it is looked whether somebody has asked.
const GLANCE: Duration = Duration::from_millis(100);
/// Until the first page is made; it asks again by itself.
const WAITING: &str = "<!doctype html><meta charset=utf-8><title>xavatar</title><p>The first page comes once the body is learned and a step \
     on the frames is made.";

/// What one `xavatar train` serves.
pub struct TrainingSite<'a> {
    run: PathBuf,
    body: &'a BodyModel,
    title: String,
    command: String,
    page: Mutex<Option<Arc<[u8]>>>,
    is_asked: AtomicBool,
    is_wanted: AtomicBool,
    is_over: AtomicBool,
    given: Mutex<Option<Avatar>>,
    arrived: Condvar,
}

impl<'a> TrainingSite<'a> {
    /// The site of a run in a folder; `command` is what its page says that it was started with.
    pub fn new(run: &Path, body: &'a BodyModel, title: String, command: String) -> Self {
        Self {
            run: run.into(),
            body,
            title,
            command,
            page: Mutex::default(),
            is_asked: AtomicBool::new(false),
            is_wanted: AtomicBool::new(false),
            is_over: AtomicBool::new(false),
            given: Mutex::default(),
            arrived: Condvar::new(),
        }
    }

    /// Whether a page is to be made, and waits for the avatar.
    pub fn wants_avatar(&self) -> bool {
        self.is_wanted.swap(false, Ordering::SeqCst)
    }

    /// Takes the avatar as it is now.
    pub fn give(&self, avatar: Avatar) {
        *held(&self.given) = Some(avatar);
        self.arrived.notify_all();
    }

    /// No more pages are made.
    pub fn end(&self) {
        self.is_over.store(true, Ordering::SeqCst);
        self.arrived.notify_all();
    }

    /// Makes pages until [`end`](Self::end). One that cannot be made is said, and no end of the training.
    pub fn make_pages(&self) {
        let mut next = Instant::now();
        while !self.is_over.load(Ordering::SeqCst) {
            if Instant::now() < next || !self.is_asked.swap(false, Ordering::SeqCst) {
                std::thread::sleep(GLANCE);
                continue;
            }
            self.is_wanted.store(true, Ordering::SeqCst);
            let Some(avatar) = self.arrival() else { return };
            let began = Instant::now();
            match self.made(&avatar) {
                Ok(page) => *held(&self.page) = Some(page),
                Err(error) => log::warn!("the page of the training: {error}"),
            }
            next = Instant::now() + REST * began.elapsed();
        }
    }

    /// Waits for the avatar; none if the training has ended.
    fn arrival(&self) -> Option<Avatar> {
        let mut given = held(&self.given);
        loop {
            if self.is_over.load(Ordering::SeqCst) {
                return None;
            }
            if let Some(avatar) = given.take() {
                return Some(avatar);
            }
            given = self.arrived.wait_timeout(given, GLANCE).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn made(&self, avatar: &Avatar) -> Result<Arc<[u8]>> {
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| {
            Error::from(InputError::Value {
                name: "a thread for the page".into(),
                found: error.to_string(),
                expected: "one more thread".into(),
            })
        })?;
        alone.install(|| {
            let rig = quick_dancing_rig(avatar, self.body)?;
            let page = Report {
                title: self.title.clone(),
                command: self.command.clone(),
                avatar,
                rig: rig.as_ref(),
                run: Some(&self.run),
                evaluation: None,
                frames: Vec::new(),
                pictures: Vec::new(),
                facts: machine(),
            };
            Ok(page.html()?.into_bytes().into())
        })
    }
}

impl Answer for TrainingSite<'_> {
    fn answer(&self, request: &Request) -> Response {
        let html =
            |fields, body| Response { status: Status::Ok, content_type: "text/html; charset=utf-8", fields, body };
        match (request.path.as_str(), request.method.as_str()) {
            ("/", "GET" | "HEAD") => {
                self.is_asked.store(true, Ordering::SeqCst);
                match held(&self.page).clone() {
                    Some(page) => html(Vec::new(), page),
                    None => html(vec![("Refresh", "2".into())], WAITING.as_bytes().into()),
                }
            }
            ("/", _) => not_allowed("GET, HEAD"),
            _ => Response::text(Status::NotFound, "nothing is here"),
        }
    }
}

/// What is behind a lock. Nothing that is done while it is held fails.
fn held<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}
