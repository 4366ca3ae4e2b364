//! Connections to answers. One thread accepts connections, one asks all of them what is new and gives the quick answers, one
//! makes the answers that take long: a client that is slow, silent or gone holds up nobody.
//!
//! Bounded: the connections at a time (the oldest that has not asked yet gives way to a new one), what each may send and take of
//! memory and time (`http`, `connection`), the long answers that are waited for (`waiting`).

use std::collections::BTreeMap;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use super::connection::{Connection, Step};
use super::http::{Request, Response, Status};
use super::origin::Names;
use super::waiting::Waiting;
use crate::{Error, InputError, Result};

/// Connections at a time.
const MOST_CONNECTIONS: usize = 256;
/// Connections that are accepted while the others are being asked.
const ACCEPTED_AHEAD: usize = 64;
/// Between attempts when the system gives no more connections.
const BACK_OFF: Duration = Duration::from_millis(50);
/// Between rounds of asking: after one in which something moved, and at most.
const PAUSES: (Duration, Duration) = (Duration::from_millis(1), Duration::from_millis(10));

/// Makes answers of requests.
pub trait Answer: Sync {
    /// The answer to a request of our own page, or of a program.
    fn answer(&self, request: &Request) -> Response;

    /// Whether the answer takes long. Such answers are made one at a time, those of one client only for its latest request, and
    /// none for clients that are gone.
    fn takes_long(&self, _request: &Request) -> bool {
        false
    }
}

/// A server that listens, and serves once it is run.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    names: Names,
    stopped: Arc<AtomicBool>,
}

/// Ends a server from elsewhere.
#[derive(Clone)]
pub struct Stop {
    stopped: Arc<AtomicBool>,
    address: SocketAddr,
}

impl Stop {
    /// Takes no more connections; answers under way are finished.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::SeqCst);
        // The server waits for a connection: this is one. If it fails there is nobody waiting.
        let _ = TcpStream::connect_timeout(&self.address, BACK_OFF);
    }
}

impl Server {
    /// Listens on `host`, a name or an address of this machine; on any free port for port 0.
    ///
    /// # Errors
    /// [`InputError::Value`] naming host and port if nobody can listen there.
    pub fn bind(host: &str, port: u16) -> Result<Self> {
        let bound = TcpListener::bind((host, port));
        let (listener, address) =
            bound.and_then(|listener| listener.local_addr().map(|address| (listener, address))).map_err(|error| {
                Error::from(InputError::Value {
                    name: "the address to serve on".into(),
                    found: format!("{host} port {port}: {error}"),
                    expected: "an address of this machine and a free port".into(),
                })
            })?;
        Ok(Self { listener, address, names: Names::new(host), stopped: Arc::default() })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What ends [`run`](Self::run).
    pub fn stop(&self) -> Stop {
        // All addresses at once are nobody's address; the machine itself is among them.
        let mut address = self.address;
        match address.ip() {
            ip if !ip.is_unspecified() => {}
            std::net::IpAddr::V4(_) => address.set_ip(std::net::Ipv4Addr::LOCALHOST.into()),
            std::net::IpAddr::V6(_) => address.set_ip(std::net::Ipv6Addr::LOCALHOST.into()),
        }
        Stop { stopped: self.stopped.clone(), address }
    }

    /// Serves until it is stopped.
    pub fn run(&self, answers: &dyn Answer) {
        let (events, heard) = sync_channel(ACCEPTED_AHEAD);
        let (orders, to_make) = sync_channel::<(Token, Request)>(1);
        thread::scope(|scope| {
            let made = events.clone();
            scope.spawn(move || {
                for (token, request) in to_make {
                    if made.send(Event::Answered(token, answer(answers, &request))).is_err() {
                        return;
                    }
                }
            });
            scope.spawn(move || self.accept(&events));
            Service {
                answers,
                names: &self.names,
                connections: BTreeMap::new(),
                next_token: 0,
                waiting: Waiting::new(),
                under_way: None,
                orders,
                is_stopping: false,
            }
            .run(&heard);
        });
    }

    fn accept(&self, events: &SyncSender<Event>) {
        for connection in self.listener.incoming() {
            if self.stopped.load(Ordering::SeqCst) {
                break;
            }
            match connection {
                Ok(connection) => {
                    if events.send(Event::Connected(connection)).is_err() {
                        return;
                    }
                }
                Err(_) => thread::sleep(BACK_OFF),
            }
        }
        // If nobody hears it, the service is over already.
        let _ = events.send(Event::Stopped);
    }
}

/// The answer; one that fails in an unforeseen way is no end of the server.
fn answer(answers: &dyn Answer, request: &Request) -> Response {
    catch_unwind(AssertUnwindSafe(|| answers.answer(request)))
        .unwrap_or_else(|_| Response::text(Status::InternalServerError, "the answer could not be made"))
}

/// Names a connection; later ones are larger.
type Token = u64;

enum Event {
    Connected(TcpStream),
    /// A long answer is made.
    Answered(Token, Response),
    Stopped,
}

/// What the asking thread knows.
struct Service<'a> {
    answers: &'a dyn Answer,
    names: &'a Names,
    connections: BTreeMap<Token, Connection>,
    next_token: Token,
    waiting: Waiting<Token>,
    /// Whose long answer is being made, and since when.
    under_way: Option<(Token, Instant)>,
    orders: SyncSender<(Token, Request)>,
    is_stopping: bool,
}

impl Service<'_> {
    fn run(mut self, heard: &Receiver<Event>) {
        let mut pause = PAUSES.0;
        while !(self.is_stopping && self.connections.is_empty() && self.under_way.is_none()) {
            let idle = self.connections.is_empty();
            let event = if idle { heard.recv().ok() } else { heard.recv_timeout(pause).ok() };
            let mut is_moving = event.is_some();
            for event in event.into_iter().chain(heard.try_iter().take(ACCEPTED_AHEAD)) {
                self.hear(event);
            }
            is_moving |= self.ask_all();
            self.order();
            pause = if is_moving { PAUSES.0 } else { (2 * pause).min(PAUSES.1) };
        }
    }

    fn hear(&mut self, event: Event) {
        match event {
            Event::Connected(stream) => self.welcome(stream),
            Event::Answered(token, response) => {
                if let Some((_, begin)) = self.under_way.take() {
                    self.waiting.note_duration(begin.elapsed());
                }
                self.respond(token, &response, true);
                self.turn_away();
            }
            Event::Stopped => {
                self.is_stopping = true;
                self.connections.retain(|_, connection| !connection.is_receiving());
                while let Some((token, _)) = self.waiting.take() {
                    self.respond(token, &Response::text(Status::ServiceUnavailable, "the server was ended"), true);
                }
            }
        }
    }

    fn welcome(&mut self, stream: TcpStream) {
        // A client that is gone already is no error of the server's.
        let Ok(connection) = Connection::new(stream, Instant::now()) else { return };
        let token = self.next_token;
        self.next_token += 1;
        self.connections.insert(token, connection);
        if self.connections.len() > MOST_CONNECTIONS {
            let silent = self.connections.iter().find(|(_, connection)| connection.is_receiving());
            let gives_way = silent.map_or(token, |(silent, _)| *silent);
            self.respond(gives_way, &Response::text(Status::ServiceUnavailable, "busy: try again in a moment"), true);
            // Head and body, as far as the system takes them at once.
            if let Some(mut connection) = self.connections.remove(&gives_way) {
                (0..2).for_each(|_| drop(connection.step(Instant::now())));
            }
        }
    }

    /// Lets every connection go on; whether any did.
    fn ask_all(&mut self) -> bool {
        let now = Instant::now();
        let mut is_moving = false;
        let mut asked = Vec::new();
        self.connections.retain(|token, connection| match connection.step(now) {
            Step::Still => true,
            Step::Moved => {
                is_moving = true;
                true
            }
            Step::Asks(request) => {
                asked.push((*token, request));
                true
            }
            Step::Over => {
                self.waiting.remove(*token);
                false
            }
        });
        is_moving |= !asked.is_empty();
        for (token, request) in asked {
            self.take_in(token, request);
        }
        is_moving
    }

    fn take_in(&mut self, token: Token, request: Request) {
        let with_body = request.method != "HEAD";
        if let Err(refused) = self.names.check(&request) {
            return self.respond(token, &refused, with_body);
        }
        if !self.answers.takes_long(&request) {
            return self.respond(token, &answer(self.answers, &request), with_body);
        }
        if let Some(older) = self.waiting.put(token, request) {
            let text = "a newer request of this client took its place";
            self.respond(older, &Response::text(Status::ServiceUnavailable, text), true);
        }
        self.turn_away();
    }

    /// Tells those at once whom the line is too long for.
    fn turn_away(&mut self) {
        while let Some(token) = self.waiting.take_surplus() {
            self.respond(token, &Response::text(Status::ServiceUnavailable, "busy: try again in a moment"), true);
        }
    }

    /// Has the next long answer made, if none is under way.
    fn order(&mut self) {
        while self.under_way.is_none() {
            let Some((token, request)) = self.waiting.take() else { return };
            if self.connections.get_mut(&token).is_none_or(Connection::is_gone) {
                self.connections.remove(&token);
            } else if self.orders.send((token, request)).is_ok() {
                self.under_way = Some((token, Instant::now()));
            }
        }
    }

    fn respond(&mut self, token: Token, response: &Response, with_body: bool) {
        if let Some(connection) = self.connections.get_mut(&token) {
            connection.answer(response, with_body, Instant::now());
        }
    }
}
