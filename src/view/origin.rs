//! Who may ask: pages of this server, and programs on this machine; no other page that happens to be open in the browser.
//!
//! A page elsewhere can make a name of its own resolve to this machine (DNS rebinding): the request then carries that name as its
//! Host. So a Host is an address, `localhost`, or the name that the user gave; and an Origin, where there is one, is the Host's.

use std::net::IpAddr;

use super::http::{Request, Response, Status};

/// The names that a server answers to.
#[derive(Clone, Debug)]
pub(super) struct Names {
    /// As the user gave it.
    given: String,
}

impl Names {
    pub(super) fn new(given: &str) -> Self {
        Self { given: given.to_ascii_lowercase() }
    }

    /// Refuses requests that a foreign page may have caused.
    pub(super) fn check(&self, request: &Request) -> Result<(), Response> {
        let host = request.field("host").unwrap_or_default().to_ascii_lowercase();
        if !self.is_ours(&host) {
            let text = format!(
                "this server does not answer to the name {host:?}; use localhost, its address, or the name that it was started under"
            );
            return Err(Response::text(Status::MisdirectedRequest, text));
        }
        match request.field("origin") {
            Some(origin) if !origin.eq_ignore_ascii_case(&format!("http://{host}")) => {
                Err(Response::text(Status::Forbidden, "this server answers its own page only"))
            }
            _ => Ok(()),
        }
    }

    fn is_ours(&self, host: &str) -> bool {
        let Some(name) = without_port(host) else { return false };
        let address = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        name == "localhost" || name == self.given || address.parse::<IpAddr>().is_ok()
    }
}

/// The name of `name`, `name:port`, `[address]` or `[address]:port`.
fn without_port(host: &str) -> Option<&str> {
    let end = match host.strip_prefix('[') {
        Some(rest) => rest.find(']')? + 2,
        None => host.find(':').unwrap_or(host.len()),
    };
    let (name, port) = host.split_at(end);
    let is_port = |port: &str| !port.is_empty() && port.bytes().all(|byte| byte.is_ascii_digit());
    (port.is_empty() || port.strip_prefix(':').is_some_and(is_port)).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_addresses_localhost_and_the_given_name_are_ours() {
        let names = Names::new("Studio.local");
        for host in
            ["localhost", "localhost:8000", "127.0.0.1:1", "192.168.1.7:80", "[::1]:8000", "[::1]", "studio.local:9"]
        {
            assert!(names.is_ours(host), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "evil.example:8000",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "[::1]x",
            "[::1",
            "localhost:",
            "localhost:80:80",
            "127.0.0.1@evil.example",
            "localhost:8o",
        ] {
            assert!(!names.is_ours(host), "{host}");
        }
    }
}
