//! One connection, which nobody waits for: it is asked again and again, and does what it can at once.
//!
//! Receiving -> waiting for the answer -> sending -> lingering, so that a client that is still sending sees the answer and no reset
//! connection. Each state but the second ends by itself after some time.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::http::{BEGIN, Request, Response, Status};

/// How long a request may take to arrive.
const REQUEST_TIME: Duration = Duration::from_secs(5);
/// How long an answer may take to be received.
const ANSWER_TIME: Duration = Duration::from_secs(20);
/// What is read, and dropped, after the answer.
const LINGER_LIMIT: usize = 4 << 20;
const LINGER_TIME: Duration = Duration::from_millis(500);

/// A client, and how far its one request is.
pub(super) struct Connection {
    stream: TcpStream,
    state: State,
    deadline: Instant,
    /// Bytes of the answer's beginning that went out before the rest was known.
    begun: usize,
    /// The client sends no more; it may still be listening, or be gone.
    is_half_closed: bool,
}

enum State {
    Receiving(Vec<u8>),
    Waiting,
    Sending { head: Vec<u8>, body: Arc<[u8]>, sent: usize },
    Lingering { dropped: usize },
}

/// What came of asking a connection.
#[derive(Debug, PartialEq)]
pub(super) enum Step {
    /// Nothing new.
    Still,
    /// Bytes came or went.
    Moved,
    /// Its request is complete; [`Connection::answer`] is next.
    Asks(Request),
    /// It is over.
    Over,
}

impl Connection {
    pub(super) fn new(stream: TcpStream, now: Instant) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        // Answers are written in two pieces at most: waiting to fill packets would only delay them.
        stream.set_nodelay(true)?;
        let state = State::Receiving(Vec::new());
        Ok(Self { stream, state, deadline: now + REQUEST_TIME, begun: 0, is_half_closed: false })
    }

    /// Whether its request is still to come.
    pub(super) fn is_receiving(&self) -> bool {
        matches!(self.state, State::Receiving(_))
    }

    /// Goes on as far as it can without waiting.
    pub(super) fn step(&mut self, now: Instant) -> Step {
        let is_late = now >= self.deadline;
        match self.state {
            State::Receiving(_) if is_late => {
                self.answer(&Response::text(Status::RequestTimeout, "the request did not arrive in time"), true, now);
                Step::Moved
            }
            State::Receiving(_) => self.receive(now),
            State::Waiting => match self.is_gone() {
                true => Step::Over,
                false => Step::Still,
            },
            State::Sending { .. } | State::Lingering { .. } if is_late => Step::Over,
            State::Sending { .. } => self.send(now),
            State::Lingering { .. } => self.linger(),
        }
    }

    /// Starts to send the answer; all but its body if `with_body` is false.
    pub(super) fn answer(&mut self, response: &Response, with_body: bool, now: Instant) {
        let body = if with_body { response.body.clone() } else { Arc::default() };
        self.state = State::Sending { head: response.head(), body, sent: self.begun };
        self.deadline = now + ANSWER_TIME;
    }

    /// Whether the client is known to be gone.
    ///
    /// One that only ended its side of the connection looks the same until it is sent something: so it gets the words that every
    /// answer begins with.
    pub(super) fn is_gone(&mut self) -> bool {
        if !self.is_half_closed {
            match self.stream.read(&mut [0; 1024]) {
                Ok(0) => {
                    self.is_half_closed = true;
                    match self.stream.write(BEGIN.as_bytes()) {
                        Ok(count) => self.begun = count,
                        Err(error) if is_wait(&error) => {}
                        Err(_) => return true,
                    }
                }
                Ok(_) => return false,
                Err(error) if is_wait(&error) => return false,
                Err(_) => return true,
            }
        }
        !matches!(self.stream.take_error(), Ok(None))
    }

    fn receive(&mut self, now: Instant) -> Step {
        let State::Receiving(bytes) = &mut self.state else { return Step::Over };
        let mut piece = [0; 4096];
        let refused = match self.stream.read(&mut piece) {
            Ok(0) if bytes.is_empty() => return Step::Over,
            Ok(0) => {
                self.is_half_closed = true;
                Response::text(Status::BadRequest, "the request ends before it is complete")
            }
            Ok(count) => {
                bytes.extend_from_slice(&piece[..count]);
                match Request::parse(bytes) {
                    Ok(None) => return Step::Moved,
                    Ok(Some(request)) => {
                        self.state = State::Waiting;
                        return Step::Asks(request);
                    }
                    Err(response) => response,
                }
            }
            Err(error) if is_wait(&error) => return Step::Still,
            Err(_) => return Step::Over,
        };
        self.answer(&refused, true, now);
        Step::Moved
    }

    fn send(&mut self, now: Instant) -> Step {
        let State::Sending { head, body, sent } = &mut self.state else { return Step::Over };
        let rest = match head.get(*sent..) {
            Some(rest) if !rest.is_empty() => rest,
            _ => body.get(*sent - head.len()..).unwrap_or_default(),
        };
        if rest.is_empty() {
            if self.stream.shutdown(Shutdown::Write).is_err() {
                return Step::Over;
            }
            (self.state, self.deadline) = (State::Lingering { dropped: 0 }, now + LINGER_TIME);
            return Step::Moved;
        }
        match self.stream.write(rest) {
            Ok(0) => Step::Over,
            Ok(count) => {
                *sent += count;
                Step::Moved
            }
            Err(error) if is_wait(&error) => Step::Still,
            Err(_) => Step::Over,
        }
    }

    fn linger(&mut self) -> Step {
        let State::Lingering { dropped } = &mut self.state else { return Step::Over };
        match self.stream.read(&mut [0; 4096]) {
            Ok(count @ 1..) if *dropped < LINGER_LIMIT => {
                *dropped += count;
                Step::Moved
            }
            Err(error) if is_wait(&error) => Step::Still,
            Ok(_) | Err(_) => Step::Over,
        }
    }
}

fn is_wait(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    /// Both ends of a connection.
    fn pair() -> (Connection, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (Connection::new(listener.accept().unwrap().0, Instant::now()).unwrap(), client)
    }

    /// Asks until something else than `Still` or `Moved` comes of it.
    fn outcome(connection: &mut Connection) -> Step {
        loop {
            match connection.step(Instant::now()) {
                Step::Still => std::thread::sleep(Duration::from_millis(1)),
                Step::Moved => {}
                other => return other,
            }
        }
    }

    fn asking() -> (Connection, TcpStream) {
        let (mut connection, mut client) = pair();
        client.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
        assert!(matches!(outcome(&mut connection), Step::Asks(request) if request.path == "/"));
        (connection, client)
    }

    fn received(mut client: TcpStream) -> String {
        let mut text = String::new();
        client.read_to_string(&mut text).unwrap();
        text
    }

    // Both have ended their side; only one is listening.
    #[test]
    fn a_client_that_listens_is_told_from_one_that_is_gone() {
        let (mut connection, client) = asking();
        client.shutdown(Shutdown::Write).unwrap();
        while !connection.is_half_closed {
            assert!(!connection.is_gone());
        }
        assert_eq!(connection.step(Instant::now()), Step::Still);
        connection.answer(&Response::text(Status::Ok, "here"), true, Instant::now());
        let reader = std::thread::spawn(move || received(client));
        assert_eq!(outcome(&mut connection), Step::Over);
        let text = reader.join().unwrap();
        assert!(text.starts_with("HTTP/1.1 200 OK\r\n") && text.ends_with("\r\n\r\nhere\n"), "{text}");

        let (mut connection, client) = asking();
        assert_eq!(connection.step(Instant::now()), Step::Still);
        drop(client);
        assert_eq!(outcome(&mut connection), Step::Over);
    }

    #[test]
    fn a_request_that_does_not_arrive_is_answered_in_the_end() {
        let (mut connection, mut client) = pair();
        client.write_all(b"GET / HTT").unwrap();
        let now = Instant::now();
        while connection.step(now) != Step::Moved {}
        assert!(connection.is_receiving());
        connection.step(now + REQUEST_TIME);
        let reader = std::thread::spawn(move || received(client));
        assert_eq!(outcome(&mut connection), Step::Over);
        assert!(reader.join().unwrap().starts_with("HTTP/1.1 408 "));
    }

    #[test]
    fn an_answer_that_is_not_received_is_given_up() {
        let (mut connection, client) = asking();
        let body = vec![7; 64 << 20].into();
        let response = Response { body, ..Response::text(Status::Ok, "") };
        let now = Instant::now();
        connection.answer(&response, true, now);
        while connection.step(now) == Step::Moved {}
        assert_eq!(connection.step(now), Step::Still);
        assert_eq!(connection.step(now + ANSWER_TIME), Step::Over);
        drop(client);
    }
}
