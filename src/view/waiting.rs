//! Requests whose answers take long, in the order in which these are made: one a client, its latest.
//!
//! A client is who says so in `X-Client`; all that do not are one. What gives way is told at once, so that nobody waits for an
//! answer that nobody wants any more. The line is no longer than what is answered in [`LONGEST_WAIT`], by how long the last answer
//! took, nor than [`LONGEST`]: who comes last is answered soon, and who is first of too many is told to come again.

use std::collections::VecDeque;
use std::time::Duration;

use super::http::Request;

/// Most clients in the line.
const LONGEST: usize = 16;
/// Longest that a client should wait for those before it.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// The line. `Token`s name connections.
pub(super) struct Waiting<Token> {
    line: VecDeque<(Token, Request)>,
    longest: usize,
}

impl<Token: Copy + PartialEq> Waiting<Token> {
    pub(super) fn new() -> Self {
        Self { line: VecDeque::new(), longest: LONGEST }
    }

    /// Puts a request into the line: at its end, or in the place of its client's older one, which gives way and is returned.
    pub(super) fn put(&mut self, token: Token, request: Request) -> Option<Token> {
        if let Some(older) = self.line.iter_mut().find(|(_, other)| client(other) == client(&request)) {
            let (older, _) = std::mem::replace(older, (token, request));
            return Some(older);
        }
        self.line.push_back((token, request));
        None
    }

    /// Learns how long an answer takes.
    pub(super) fn note_duration(&mut self, answer: Duration) {
        let answered = LONGEST_WAIT.as_secs_f64() / answer.as_secs_f64().max(f64::MIN_POSITIVE);
        self.longest = (answered as usize).clamp(1, LONGEST);
    }

    /// Takes out who waits longest, if the line is too long.
    pub(super) fn take_surplus(&mut self) -> Option<Token> {
        if self.line.len() <= self.longest {
            return None;
        }
        self.line.pop_front().map(|(oldest, _)| oldest)
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
        assert_eq!(waiting.put(3, request("a")), Some(1));
        assert_eq!(waiting.put(4, request("c")), None);
        waiting.remove(2);
        assert_eq!(order(waiting), [3, 4], "its place stays");
    }

    #[test]
    fn clients_without_a_name_are_one() {
        let mut waiting = Waiting::new();
        let nameless = || Request::parse(b"GET / HTTP/1.1\r\n\r\n").unwrap().unwrap();
        assert_eq!(waiting.put(1, nameless()), None);
        assert_eq!(waiting.put(2, nameless()), Some(1));
        assert_eq!(order(waiting), [2]);
    }

    #[test]
    fn the_line_is_as_long_as_its_wait_and_the_newest_is_in_it() {
        // Before an answer was made, after slow ones, and after quick ones.
        for (took, length) in
            [(None, LONGEST), (Some(0.2), 5), (Some(9.0), 1), (Some(1e-3), LONGEST), (Some(0.0), LONGEST)]
        {
            let mut waiting = Waiting::new();
            if let Some(took) = took {
                waiting.note_duration(Duration::from_secs_f64(took));
            }
            let mut given_way = Vec::new();
            for token in 0..100 {
                assert_eq!(waiting.put(token, request(&token.to_string())), None);
                given_way.extend(waiting.take_surplus());
            }
            assert_eq!(given_way, (0..100 - length as u32).collect::<Vec<_>>(), "{took:?}");
            assert_eq!(order(waiting).last(), Some(&99));
        }
    }

    #[test]
    fn answers_that_take_longer_than_before_shorten_the_line() {
        let mut waiting = Waiting::new();
        assert!((0..4).all(|token| waiting.put(token, request(&token.to_string())).is_none()));
        waiting.note_duration(Duration::from_millis(400));
        assert_eq!([waiting.take_surplus(), waiting.take_surplus(), waiting.take_surplus()], [Some(0), Some(1), None]);
    }
}
