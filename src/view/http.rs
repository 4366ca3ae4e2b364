//! Requests out of bytes and answers to bytes, as much of HTTP/1.1 as a page and its script need.
//!
//! Heads are parsed by `httparse`. What a request may cost is bounded: the bytes of its head and of its body, the number of its
//! fields. Bodies need a length: chunks are refused. What could mean one thing here and another to a proxy is refused as well.

use std::sync::Arc;

/// Largest head, bytes.
const HEAD_LIMIT: usize = 16 << 10;
/// Most header fields.
const FIELD_LIMIT: usize = 64;
/// Largest body, bytes: parameters of one pose take about 5 KiB.
const BODY_LIMIT: usize = 64 << 10;
/// How every answer begins, whatever it is.
pub(super) const BEGIN: &str = "HTTP/1.1 ";

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
    /// The content; one that many answers have is not copied for each.
    pub body: Arc<[u8]>,
}

impl Response {
    /// A line of text, for errors.
    pub fn text(status: Status, text: impl std::fmt::Display) -> Self {
        let body = format!("{text}\n").into_bytes().into();
        Self { status, content_type: "text/plain; charset=utf-8", fields: Vec::new(), body }
    }

    /// The answer's first lines, up to the empty one.
    pub(super) fn head(&self) -> Vec<u8> {
        let mut head = format!(
            "{BEGIN}{} {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
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
        head.into_bytes()
    }
}

/// Why a request was not understood.
type Refusal = (Status, &'static str);

impl Request {
    /// The request that `bytes` begin with; none if more have to come.
    ///
    /// # Errors
    /// The answer to what is no request, or too large a one.
    pub fn parse(bytes: &[u8]) -> Result<Option<Self>, Response> {
        Self::parsed(bytes).map_err(|(status, text)| Response::text(status, text))
    }

    fn parsed(bytes: &[u8]) -> Result<Option<Self>, Refusal> {
        let Some((mut request, length, head)) = parse_head(&bytes[..bytes.len().min(HEAD_LIMIT)])? else {
            return match bytes.len() < HEAD_LIMIT {
                true => Ok(None),
                false => Err((Status::RequestHeaderFieldsTooLarge, "the request's head is too large")),
            };
        };
        let Some(body) = bytes.get(head..head + length) else { return Ok(None) };
        request.body = body.to_vec();
        Ok(Some(request))
    }
}

/// The request without its body, the body's length and the head's; none if the head is not complete.
fn parse_head(bytes: &[u8]) -> Result<Option<(Request, usize, usize)>, Refusal> {
    let mut fields = [httparse::EMPTY_HEADER; FIELD_LIMIT];
    let mut head = httparse::Request::new(&mut fields);
    let length = match head.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(httparse::Error::TooManyHeaders) => {
            return Err((Status::RequestHeaderFieldsTooLarge, "the request has too many header fields"));
        }
        Err(_) => return Err((Status::BadRequest, "this is not an HTTP/1.1 request")),
    };
    let mut named = Vec::new();
    for field in head.headers.iter() {
        let Ok(value) = std::str::from_utf8(field.value) else {
            return Err((Status::BadRequest, "a header field is not text"));
        };
        let name = field.name.to_ascii_lowercase();
        // Which of two is meant decides who is asked, and by whom.
        if matches!(name.as_str(), "host" | "origin") && named.iter().any(|(other, _)| *other == name) {
            return Err((Status::BadRequest, "the request has two Host or two Origin fields"));
        }
        named.push((name, value.trim().to_owned()));
    }
    let target = head.path.unwrap_or_default();
    if !target.starts_with('/') {
        return Err((Status::BadRequest, "the request's target is not a path"));
    }
    let path = target.split('?').next().unwrap_or_default().to_owned();
    let request = Request { method: head.method.unwrap_or_default().into(), path, fields: named, body: Vec::new() };
    let body = body_length(&request)?;
    Ok(Some((request, body, length)))
}

fn body_length(request: &Request) -> Result<usize, Refusal> {
    if request.field("transfer-encoding").is_some() {
        return Err((Status::LengthRequired, "send the body's length, not chunks"));
    }
    if request.field("expect").is_some() {
        return Err((Status::ExpectationFailed, "send the body at once"));
    }
    let mut lengths = request.fields.iter().filter(|(name, _)| name == "content-length").map(|(_, value)| value);
    let Some(length) = lengths.next() else {
        return match request.method.as_str() {
            "POST" | "PUT" | "PATCH" => Err((Status::LengthRequired, "the request has no Content-Length")),
            _ => Ok(0),
        };
    };
    // Two lengths, or a sign, are how requests are smuggled past a proxy.
    if lengths.next().is_some() || length.is_empty() || !length.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err((Status::BadRequest, "the Content-Length is not one number"));
    }
    match length.parse::<usize>() {
        Ok(length) if length <= BODY_LIMIT => Ok(length),
        _ => Err((Status::ContentTooLarge, "the request's body is too large")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POST: &[u8] = b"POST /mesh?x=1 HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\n\r\nabc and more";

    #[test]
    fn a_request_is_complete_when_its_body_is() {
        let end = POST.len() - " and more".len();
        for length in 0..end {
            assert_eq!(Request::parse(&POST[..length]).unwrap(), None, "{length}");
        }
        let request = Request::parse(POST).unwrap().unwrap();
        assert_eq!(
            (request.method.as_str(), request.path.as_str(), request.body.as_slice()),
            ("POST", "/mesh", &b"abc"[..])
        );
        assert_eq!(request.field("host"), Some("localhost"));
    }

    #[test]
    fn a_second_host_or_origin_is_refused() {
        for field in ["Host", "HOST", "Origin"] {
            let request =
                format!("GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://localhost\r\n{field}: x\r\n\r\n");
            assert_eq!(Request::parse(request.as_bytes()).unwrap_err().status, Status::BadRequest, "{field}");
        }
        assert!(Request::parse(b"GET / HTTP/1.1\r\nAccept: a\r\nAccept: b\r\n\r\n").unwrap().is_some());
    }

    #[test]
    fn heads_without_end_are_refused() {
        let head = [&b"GET / HTTP/1.1\r\nLong: "[..], &[b'x'; HEAD_LIMIT]].concat();
        assert_eq!(Request::parse(&head).unwrap_err().status, Status::RequestHeaderFieldsTooLarge);
    }
}
