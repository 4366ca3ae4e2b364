//! Requests whose answers take long, in the order in which these are made: one a client, its latest.
//!
//! A client is who says so in `X-Client`; all that do not are one. What gives way is told at once, so that nobody waits for an
//! answer that nobody wants any more, and the line is never longer than [`LONGEST`].

use std::collections::VecDeque;

use super::http::Request;

/// Most clients in the line.
const LONGEST: usize = 16;

/// The line. `Token`s name connections.
pub(super) struct Waiting<Token> {
    line: VecDeque<(Token, Request)>,
}

/// Why a request is not answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Displaced {
    /// By a newer one of the same client.
    ByNewer,
    /// By other clients.
    ByOthers,
}

impl<Token: Copy + PartialEq> Waiting<Token> {
    pub(super) fn new() -> Self {
        Self { line: VecDeque::new() }
    }

    /// Puts a request into the line: at its end, or in the place of its client's older one. Returns the one that gives way.
    pub(super) fn put(&mut self, token: Token, request: Request) -> Option<(Token, Displaced)> {
        if let Some(older) = self.line.iter_mut().find(|(_, other)| client(other) == client(&request)) {
            let (older, _) = std::mem::replace(older, (token, request));
            return Some((older, Displaced::ByNewer));
        }
        self.line.push_back((token, request));
        if self.line.len() <= LONGEST {
            return None;
        }
        self.line.pop_front().map(|(oldest, _)| (oldest, Displaced::ByOthers))
    }

    /// Takes the next request out.
    pub(super) fn take(&mut self) -> Option<(Token, Request)> {
        self.line.pop_front()
    }

    /// Takes a connection's request out: it is gone.
    pub(super) fn remove(&mut self, token: Token) {
        self.line.retain(|(other, _)| *other != token);
    }
}

fn client(request: &Request) -> &str {
    request.field("x-client").unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(client: &str) -> Request {
        let text = format!("GET / HTTP/1.1\r\nX-Client: {client}\r\n\r\n");
        Request::parse(text.as_bytes()).unwrap().unwrap()
    }

    fn order(mut waiting: Waiting<u32>) -> Vec<u32> {
        std::iter::from_fn(|| waiting.take()).map(|(token, _)| token).collect()
    }

    #[test]
    fn a_client_waits_once_with_its_latest() {
        let mut waiting = Waiting::new();
        assert_eq!(waiting.put(1, request("a")), None);
        assert_eq!(waiting.put(2, request("b")), None);
        assert_eq!(waiting.put(3, request("a")), Some((1, Displaced::ByNewer)));
        assert_eq!(waiting.put(4, request("c")), None);
        waiting.remove(2);
        assert_eq!(order(waiting), [3, 4], "its place stays");
    }

    #[test]
    fn clients_without_a_name_are_one() {
        let mut waiting = Waiting::new();
        let nameless = || Request::parse(b"GET / HTTP/1.1\r\n\r\n").unwrap().unwrap();
        assert_eq!(waiting.put(1, nameless()), None);
        assert_eq!(waiting.put(2, nameless()), Some((1, Displaced::ByNewer)));
        assert_eq!(order(waiting), [2]);
    }

    #[test]
    fn the_line_is_bounded_and_the_newest_is_in_it() {
        let mut waiting = Waiting::new();
        let given_way: Vec<_> = (0..100)
            .filter_map(|token| waiting.put(token, request(&token.to_string())))
            .map(|(token, _)| token)
            .collect();
        assert_eq!(given_way, (0..100 - LONGEST as u32).collect::<Vec<_>>());
        assert_eq!(order(waiting).last(), Some(&99));
    }
}
