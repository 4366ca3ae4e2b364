//! Connections to answers: a bounded number of threads, each with one connection at a time, so that slow clients hold up nobody.

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use super::http::{Refusal, Request, Response, Status, linger, read_request};
use super::origin::Names;
use crate::{Error, InputError, Result};

/// Connections that are served at a time; each costs a thread that mostly waits.
const WORKERS: usize = 32;
/// Connections that wait for a thread; more are told that the server is busy.
const QUEUE: usize = 32;
/// Between attempts when the system gives no more connections.
const BACK_OFF: Duration = Duration::from_millis(50);

/// Makes answers of requests, on several threads at a time.
pub trait Answer: Sync {
    /// The answer to a request of our own page, or of a program.
    fn answer(&self, request: &Request) -> Response;
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
    /// Takes no more connections; those being answered are finished.
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
    /// [`Error::Value`] naming host and port if nobody can listen there.
    pub fn bind(host: &str, port: u16) -> Result<Self> {
        let bound = TcpListener::bind((host, port));
        let (listener, address) =
            bound.and_then(|listener| listener.local_addr().map(|address| (listener, address))).map_err(|error| {
                Error::from(InputError::Value {
                    name: "the address to serve on".into(),
                    found: format!("{host} port {port}: {error}"),
                    expected: "an address of this machine and a free port (--host, --port)".into(),
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
        let (queue, waiting) = sync_channel::<TcpStream>(QUEUE);
        let waiting = Mutex::new(waiting);
        thread::scope(|scope| {
            for _ in 0..WORKERS {
                scope.spawn(|| self.work(&waiting, answers));
            }
            for connection in self.listener.incoming() {
                if self.is_stopped() {
                    break;
                }
                match connection {
                    Ok(connection) => {
                        if let Err(TrySendError::Full(connection)) = queue.try_send(connection) {
                            let busy = Response::text(Status::ServiceUnavailable, "busy: try again in a moment");
                            let _ = busy.send(&connection, true);
                        }
                    }
                    Err(_) => thread::sleep(BACK_OFF),
                }
            }
            drop(queue);
        });
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::SeqCst)
    }

    fn work(&self, waiting: &Mutex<Receiver<TcpStream>>, answers: &dyn Answer) {
        loop {
            let next = waiting.lock().unwrap_or_else(PoisonError::into_inner).recv();
            let Ok(connection) = next else { return };
            // A client that is gone is no error of the server's.
            let _ = self.serve(&connection, answers);
        }
    }

    fn serve(&self, connection: &TcpStream, answers: &dyn Answer) -> io::Result<()> {
        // Answers are written in two pieces at most: waiting to fill packets would only delay them.
        connection.set_nodelay(true)?;
        let request = match read_request(connection, &|| self.is_stopped()) {
            Ok(request) => request,
            Err(Refusal::Gone) => return Ok(()),
            Err(Refusal::Answer(response)) => {
                response.send(connection, true)?;
                linger(connection);
                return Ok(());
            }
        };
        let response = self.names.check(&request).map_or_else(|refused| refused, |()| answers.answer(&request));
        response.send(connection, request.method != "HEAD")
    }
}
