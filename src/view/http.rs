//! One request and one answer a connection, as much of HTTP/1.1 as a page and its script need.
//!
//! Heads are parsed by `httparse`. What a request may cost is bounded: the bytes of its head and of its body, the number of its
//! fields, and the time until it is complete. Bodies need a length: chunks are refused.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Largest head, bytes.
const HEAD_LIMIT: usize = 16 << 10;
/// Most header fields.
const FIELD_LIMIT: usize = 64;
/// Largest body, bytes: parameters of one pose take about 5 KiB.
const BODY_LIMIT: usize = 64 << 10;
/// How long a request may take to arrive.
const REQUEST_TIME: Duration = Duration::from_secs(5);
/// How long an answer may take to be received.
const ANSWER_TIME: Duration = Duration::from_secs(20);
/// How long a read blocks before it is asked whether the server stops.
const TICK: Duration = Duration::from_millis(200);
/// Bytes that are read after a refusal, so that the client sees the answer and no reset connection.
const LINGER_LIMIT: usize = 4 << 20;
const LINGER_TIME: Duration = Duration::from_millis(500);

/// A request that has arrived completely.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// As sent.
    pub method: String,
    /// Without the query.
    pub path: String,
    /// Names in lower case.
    fields: Vec<(String, String)>,
    /// As long as it said.
    pub body: Vec<u8>,
}

impl Request {
    /// The value of a header field, by its name in lower case.
    pub fn field(&self, name: &str) -> Option<&str> {
        self.fields.iter().find(|(field, _)| field == name).map(|(_, value)| value.as_str())
    }
}

/// The status codes in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names are those of RFC 9110")]
pub enum Status {
    Ok = 200,
    BadRequest = 400,
    Forbidden = 403,
    NotFound = 404,
    MethodNotAllowed = 405,
    RequestTimeout = 408,
    LengthRequired = 411,
    ContentTooLarge = 413,
    UnsupportedMediaType = 415,
    ExpectationFailed = 417,
    MisdirectedRequest = 421,
    UnprocessableContent = 422,
    RequestHeaderFieldsTooLarge = 431,
    InternalServerError = 500,
    ServiceUnavailable = 503,
}

impl Status {
    fn reason(self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::BadRequest => "Bad Request",
            Self::Forbidden => "Forbidden",
            Self::NotFound => "Not Found",
            Self::MethodNotAllowed => "Method Not Allowed",
            Self::RequestTimeout => "Request Timeout",
            Self::LengthRequired => "Length Required",
            Self::ContentTooLarge => "Content Too Large",
            Self::UnsupportedMediaType => "Unsupported Media Type",
            Self::ExpectationFailed => "Expectation Failed",
            Self::MisdirectedRequest => "Misdirected Request",
            Self::UnprocessableContent => "Unprocessable Content",
            Self::RequestHeaderFieldsTooLarge => "Request Header Fields Too Large",
            Self::InternalServerError => "Internal Server Error",
            Self::ServiceUnavailable => "Service Unavailable",
        }
    }
}

/// An answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// How it went.
    pub status: Status,
    /// What the body is.
    pub content_type: &'static str,
    /// Further header fields.
    pub fields: Vec<(&'static str, String)>,
    /// The content.
    pub body: Vec<u8>,
}

impl Response {
    /// A line of text, for errors.
    pub fn text(status: Status, text: impl std::fmt::Display) -> Self {
        let body = format!("{text}\n").into_bytes();
        Self { status, content_type: "text/plain; charset=utf-8", fields: Vec::new(), body }
    }

    /// Sends the answer; with `with_body` false all but its body. Fails if the client takes longer than 20 seconds.
    pub(super) fn send(&self, connection: &TcpStream, with_body: bool) -> io::Result<()> {
        let mut head = format!(
            "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
             X-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\n",
            self.status as u16,
            self.status.reason(),
            self.content_type,
            self.body.len()
        );
        for (name, value) in &self.fields {
            head += &format!("{name}: {value}\r\n");
        }
        head += "\r\n";
        let deadline = Instant::now() + ANSWER_TIME;
        write_all(connection, head.as_bytes(), deadline)?;
        if with_body {
            write_all(connection, &self.body, deadline)?;
        }
        Ok(())
    }
}

/// Why a request was not understood, or that there is nobody to be answered.
pub(super) enum Refusal {
    Answer(Response),
    Gone,
}

impl From<(Status, &'static str)> for Refusal {
    fn from((status, text): (Status, &'static str)) -> Self {
        Self::Answer(Response::text(status, text))
    }
}

/// Reads the request of a connection, unless `is_stopped` becomes true.
pub(super) fn read_request(connection: &TcpStream, is_stopped: &dyn Fn() -> bool) -> Result<Request, Refusal> {
    let deadline = Instant::now() + REQUEST_TIME;
    let mut bytes = Vec::new();
    let (mut request, length, head) = loop {
        if let Some(parsed) = parse_head(&bytes)? {
            break parsed;
        }
        if bytes.len() >= HEAD_LIMIT {
            return Err((Status::RequestHeaderFieldsTooLarge, "the request's head is too large").into());
        }
        let room = HEAD_LIMIT - bytes.len();
        read_some(connection, &mut bytes, room, deadline, is_stopped)?;
    };
    while bytes.len() < head + length {
        let room = head + length - bytes.len();
        read_some(connection, &mut bytes, room, deadline, is_stopped)?;
    }
    request.body = bytes[head..head + length].to_vec();
    Ok(request)
}

/// The request without its body, the body's length and the head's; none if the head is not complete.
fn parse_head(bytes: &[u8]) -> Result<Option<(Request, usize, usize)>, Refusal> {
    let mut fields = [httparse::EMPTY_HEADER; FIELD_LIMIT];
    let mut head = httparse::Request::new(&mut fields);
    let length = match head.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(httparse::Error::TooManyHeaders) => {
            return Err((Status::RequestHeaderFieldsTooLarge, "the request has too many header fields").into());
        }
        Err(_) => return Err((Status::BadRequest, "this is not an HTTP/1.1 request").into()),
    };
    let mut named = Vec::new();
    for field in head.headers.iter() {
        let Ok(value) = std::str::from_utf8(field.value) else {
            return Err((Status::BadRequest, "a header field is not text").into());
        };
        named.push((field.name.to_ascii_lowercase(), value.trim().to_owned()));
    }
    let target = head.path.unwrap_or_default();
    if !target.starts_with('/') {
        return Err((Status::BadRequest, "the request's target is not a path").into());
    }
    let path = target.split('?').next().unwrap_or_default().to_owned();
    let request = Request { method: head.method.unwrap_or_default().into(), path, fields: named, body: Vec::new() };
    let body = body_length(&request)?;
    Ok(Some((request, body, length)))
}

fn body_length(request: &Request) -> Result<usize, Refusal> {
    if request.field("transfer-encoding").is_some() {
        return Err((Status::LengthRequired, "send the body's length, not chunks").into());
    }
    if request.field("expect").is_some() {
        return Err((Status::ExpectationFailed, "send the body at once").into());
    }
    let mut lengths = request.fields.iter().filter(|(name, _)| name == "content-length").map(|(_, value)| value);
    let Some(length) = lengths.next() else {
        return match request.method.as_str() {
            "POST" | "PUT" | "PATCH" => Err((Status::LengthRequired, "the request has no Content-Length").into()),
            _ => Ok(0),
        };
    };
    // Two lengths, or a sign, are how requests are smuggled past a proxy.
    if lengths.next().is_some() || length.is_empty() || !length.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err((Status::BadRequest, "the Content-Length is not one number").into());
    }
    match length.parse::<usize>() {
        Ok(length) if length <= BODY_LIMIT => Ok(length),
        _ => Err((Status::ContentTooLarge, "the request's body is too large").into()),
    }
}

/// Reads at least one byte and at most `room`.
fn read_some(
    mut connection: &TcpStream,
    bytes: &mut Vec<u8>,
    room: usize,
    deadline: Instant,
    is_stopped: &dyn Fn() -> bool,
) -> Result<(), Refusal> {
    let mut buffer = [0; 4096];
    let room = room.min(buffer.len());
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err((Status::RequestTimeout, "the request did not arrive in time").into());
        }
        if is_stopped() || connection.set_read_timeout(Some(left.min(TICK))).is_err() {
            return Err(Refusal::Gone);
        }
        match connection.read(&mut buffer[..room]) {
            Ok(0) if bytes.is_empty() => return Err(Refusal::Gone),
            Ok(0) => return Err((Status::BadRequest, "the request ends before it is complete").into()),
            Ok(count) => {
                bytes.extend_from_slice(&buffer[..count]);
                return Ok(());
            }
            Err(error) if is_wait(&error) => {}
            Err(_) => return Err(Refusal::Gone),
        }
    }
}

fn write_all(mut connection: &TcpStream, mut bytes: &[u8], deadline: Instant) -> io::Result<()> {
    while !bytes.is_empty() {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        connection.set_write_timeout(Some(left))?;
        match connection.write(bytes) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(count) => bytes = &bytes[count..],
            Err(error) if is_wait(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Ends a connection whose request was not read to its end: closing at once would take the answer away again.
pub(super) fn linger(mut connection: &TcpStream) {
    let deadline = Instant::now() + LINGER_TIME;
    let (mut buffer, mut read) = ([0; 4096], 0);
    if connection.shutdown(std::net::Shutdown::Write).is_err() {
        return;
    }
    while read < LINGER_LIMIT {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() || connection.set_read_timeout(Some(left)).is_err() {
            return;
        }
        match connection.read(&mut buffer) {
            Ok(0) | Err(_) => return,
            Ok(count) => read += count,
        }
    }
}

fn is_wait(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}
