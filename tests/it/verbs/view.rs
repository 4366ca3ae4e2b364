//! `xavatar view`: what it answers, to whom, and that nothing it is sent does it harm.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::{Mutex, OnceLock, mpsc};
use std::time::Duration;

use glam::Vec3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar::avatar::{Animator, Avatar};
use xavatar::body::{Pose, PoseAxisAngle, smplx};
use xavatar::export::{RiggedMesh, Rigging};
use xavatar::synthetic::dance;
use xavatar::view::{Answer, Request, Response, Server, Site, Status, TrainingSite, decode_mesh};

use crate::avatars::untrained::{self, subject};

const RESOLUTION: usize = 32;

fn untrained() -> &'static Avatar {
    static AVATAR: OnceLock<Avatar> = OnceLock::new();
    AVATAR.get_or_init(untrained::untrained)
}

fn animator() -> &'static Animator<'static> {
    static ANIMATOR: OnceLock<Animator> = OnceLock::new();
    ANIMATOR.get_or_init(|| Animator::new(untrained(), subject().model(), subject().part_labels()).unwrap())
}

fn rig() -> &'static RiggedMesh {
    static RIG: OnceLock<RiggedMesh> = OnceLock::new();
    RIG.get_or_init(|| {
        let rigging = Rigging { resolution: RESOLUTION, influences: 4, correctives: 0 };
        let clip = dance();
        let frames = &clip.poses(None).unwrap()[..3];
        rigging.rig(untrained(), Some(subject().model()), frames, clip.frames_per_second, |_, _| {}).unwrap().0
    })
}

/// Runs `test` against a server of `answers`, then stops it.
fn serving(answers: &dyn Answer, test: impl FnOnce(SocketAddr)) {
    let server = Server::bind("127.0.0.1", 0).unwrap();
    let (address, stop) = (server.address(), server.stop());
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(answers));
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| test(address)));
        stop.stop();
        outcome.unwrap();
    });
}

fn site() -> Site<'static> {
    Site::new("<script>alert(1)</script>".into(), "a test".into(), rig(), Some(animator())).unwrap()
}

/// Sends bytes, ends the sending side, and returns all that comes back.
fn exchange(address: SocketAddr, sent: &[u8]) -> Vec<u8> {
    let mut connection = TcpStream::connect(address).unwrap();
    connection.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    // A server that has seen enough may answer before it was sent everything.
    let _ = connection.write_all(sent);
    let _ = connection.shutdown(Shutdown::Write);
    let mut received = Vec::new();
    let _ = connection.read_to_end(&mut received);
    received
}

fn status(received: &[u8]) -> u16 {
    let line = String::from_utf8_lossy(&received[..received.len().min(16)]).into_owned();
    let code = line.strip_prefix("HTTP/1.1 ").and_then(|line| line.get(..3)).and_then(|code| code.parse().ok());
    code.unwrap_or_else(|| panic!("not an answer: {line:?}"))
}

fn head_and_body(received: &[u8]) -> (String, &[u8]) {
    let end = received.windows(4).position(|window| window == b"\r\n\r\n").unwrap() + 4;
    (String::from_utf8(received[..end].to_vec()).unwrap(), &received[end..])
}

fn post(body: &[u8], fields: &str) -> Vec<u8> {
    let head = format!("POST /mesh HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n{fields}\r\n", body.len());
    [head.as_bytes(), body].concat()
}

const JSON: &str = "Content-Type: application/json\r\n";

#[test]
fn the_mesh_is_that_of_the_animator_for_the_same_parameters() {
    let skeleton = smplx::skeleton();
    let turns = [
        ("pelvis", Vec3::Y * 0.4),
        ("left_elbow", Vec3::new(0.1, -0.7, 0.2)),
        ("jaw", Vec3::X * 0.2),
        ("left_middle2", Vec3::Z * -0.9),
    ];
    let (expression, translation) = (vec![0.0, 0.0, 0.0, 1.5], Vec3::new(0.3, 1.1, -2.0));
    let mut pose = Pose { expression: expression.clone(), translation, ..skeleton.rest_pose() };
    for (name, turn) in turns {
        pose.rotations[skeleton.joint(name).unwrap()] = PoseAxisAngle(turn);
    }
    let rotations: std::collections::BTreeMap<_, _> = turns.into_iter().collect();
    let body = serde_json::json!({ "resolution": RESOLUTION, "pose": {
        "rotations": rotations, "expression": expression, "translation": translation,
    }});
    let expected = animator().extract(&pose, RESOLUTION).unwrap().mesh;
    serving(&site(), |address| {
        let received = exchange(address, &post(body.to_string().as_bytes(), JSON));
        let (head, body) = head_and_body(&received);
        assert_eq!(status(&received), 200, "{head}");
        let (mesh, resolution, seconds) = decode_mesh(body).unwrap();
        assert_eq!((resolution, mesh.faces.len()), (RESOLUTION, expected.faces.len()));
        assert!(seconds > 0.0);
        let pairs = mesh.vertices.iter().zip(&expected.vertices);
        let farthest = pairs.map(|(vertex, expected)| vertex.distance(*expected)).fold(0.0, f32::max);
        assert!(mesh.vertices.len() == expected.vertices.len() && farthest < 1e-5, "{farthest} m apart");
        assert_eq!(mesh.faces, expected.faces);
    });
}

#[test]
fn the_page_is_served_with_its_policy_and_its_name_escaped() {
    serving(&site(), |address| {
        let received = exchange(address, b"GET /?from=bookmark HTTP/1.1\r\nHost: localhost:80\r\n\r\n");
        let (head, body) = head_and_body(&received);
        assert_eq!(status(&received), 200);
        assert!(head.contains("Content-Security-Policy: default-src 'none'") && head.contains("nosniff"), "{head}");
        let page = String::from_utf8(body.to_vec()).unwrap();
        assert!(page.contains("&lt;script&gt;alert(1)") && !page.contains("<script>alert(1)"));
        let received = exchange(address, b"HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n");
        assert_eq!((status(&received), head_and_body(&received).1.len()), (200, 0));
    });
}

#[test]
fn other_pages_get_nothing() {
    let get = |fields: &str| format!("GET / HTTP/1.1\r\n{fields}\r\n").into_bytes();
    let valid = br#"{"pose": {}, "resolution": 16}"#;
    serving(&site(), |address| {
        // A foreign name that resolves to this machine; a foreign page; a form, which needs no permission to be sent.
        assert_eq!(status(&exchange(address, &get("Host: evil.example\r\n"))), 421);
        assert_eq!(status(&exchange(address, &get("Host: 127.0.0.1.evil.example\r\n"))), 421);
        assert_eq!(status(&exchange(address, &get(""))), 421);
        let foreign = format!("{JSON}Origin: http://evil.example\r\n");
        assert_eq!(status(&exchange(address, &post(valid, &foreign))), 403);
        assert_eq!(status(&exchange(address, &post(valid, "Content-Type: text/plain\r\n"))), 415);
        assert_eq!(status(&exchange(address, &post(valid, &format!("{JSON}Origin: http://localhost\r\n")))), 200);
    });
}

// Clients that never finish their request hold a thread each, and nobody up: the others are answered meanwhile.
#[test]
fn slow_clients_hold_nobody_up() {
    struct Quick;
    impl Answer for Quick {
        fn answer(&self, _: &Request) -> Response {
            Response::text(Status::Ok, "here")
        }
    }
    serving(&Quick, |address| {
        let mut slow: Vec<TcpStream> = (0..8).map(|_| TcpStream::connect(address).unwrap()).collect();
        slow.iter_mut().for_each(|connection| connection.write_all(b"GET / HTTP/1.1\r\nHost: local").unwrap());
        for _ in 0..20 {
            assert_eq!(status(&exchange(address, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")), 200);
        }
        for mut connection in slow {
            let mut received = Vec::new();
            connection.read_to_end(&mut received).unwrap();
            assert_eq!(status(&received), 408, "and are told in the end");
        }
    });
}

/// Answers that take as long as the test wants: those to `/held` until it says so. Notes the clients that were answered.
struct Held {
    release: Mutex<mpsc::Receiver<()>>,
    answered: Mutex<Vec<String>>,
}

impl Held {
    fn new() -> (Self, mpsc::Sender<()>) {
        let (sender, receiver) = mpsc::channel();
        (Self { release: Mutex::new(receiver), answered: Mutex::default() }, sender)
    }
}

impl Answer for Held {
    fn answer(&self, request: &Request) -> Response {
        if request.path == "/held" {
            self.release.lock().unwrap().recv().unwrap();
        }
        self.answered.lock().unwrap().push(request.field("x-client").unwrap_or("nobody").into());
        Response::text(Status::Ok, "made")
    }

    fn takes_long(&self, request: &Request) -> bool {
        request.path != "/"
    }
}

/// Sends a request whose answer takes long, without waiting for it.
fn ask(address: SocketAddr, path: &str, client: &str) -> TcpStream {
    let mut connection = TcpStream::connect(address).unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nX-Client: {client}\r\n\r\n");
    connection.write_all(request.as_bytes()).unwrap();
    connection
}

fn answer_to(mut connection: TcpStream) -> u16 {
    let mut received = Vec::new();
    connection.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    connection.read_to_end(&mut received).unwrap();
    status(&received)
}

/// Returns once the server has read all that was sent to it before: quick answers are given in order.
fn settle(address: SocketAddr) {
    assert_eq!(answer_to(ask(address, "/", "settled")), 200);
}

#[test]
fn nothing_is_made_for_clients_that_are_gone() {
    let (answers, release) = Held::new();
    serving(&answers, |address| {
        let first = ask(address, "/held", "first");
        settle(address);
        let mut clients: Vec<_> = (0..12).map(|client| ask(address, "/long", &client.to_string())).collect();
        settle(address);
        let even = |index: &usize| index.is_multiple_of(2);
        let staying: Vec<_> =
            clients.drain(..).enumerate().filter(|(index, _)| even(index)).map(|(_, client)| client).collect();
        release.send(()).unwrap();
        assert_eq!(answer_to(first), 200);
        for client in staying {
            assert_eq!(answer_to(client), 200);
        }
    });
    let mut answered = answers.answered.into_inner().unwrap();
    answered.retain(|client| client != "settled");
    assert_eq!(answered, ["first", "0", "2", "4", "6", "8", "10"]);
}

#[test]
fn the_latest_of_a_client_wins() {
    let (answers, release) = Held::new();
    serving(&answers, |address| {
        let first = ask(address, "/held", "a");
        settle(address);
        let mut waiting = Vec::new();
        for _ in 0..5 {
            waiting.push(ask(address, "/long", "a"));
            settle(address);
        }
        let other = ask(address, "/long", "b");
        settle(address);
        let latest = waiting.pop().unwrap();
        for older in waiting {
            assert_eq!(answer_to(older), 503, "told before the first is answered");
        }
        release.send(()).unwrap();
        for answered in [first, latest, other] {
            assert_eq!(answer_to(answered), 200);
        }
    });
}

// Half a thousand connections that never ask, 64 poses of which half are gone at once: the others are answered somehow, and a client
// that comes after them gets the page and its pose.
#[test]
fn honest_clients_are_answered_in_a_crowd() {
    let pose = br#"{"pose": {}, "resolution": 32}"#;
    let site = site();
    serving(&site, |address| {
        let half = b"POST /mesh HTTP/1.1\r\nHost: local";
        let silent: Vec<TcpStream> = (0..500)
            .filter_map(|_| {
                let mut connection = TcpStream::connect(address).ok()?;
                // The server may have had enough of them by now.
                let _ = connection.write_all(half);
                Some(connection)
            })
            .collect();
        let poses: Vec<TcpStream> = (0..64)
            .map(|_| {
                let mut connection = TcpStream::connect(address).unwrap();
                connection.write_all(&post(pose, JSON)).unwrap();
                connection
            })
            .collect();
        let (gone, staying): (Vec<_>, Vec<_>) = poses.into_iter().enumerate().partition(|(index, _)| index % 2 == 0);
        drop(gone);
        let honest = exchange(address, &post(pose, &format!("{JSON}X-Client: honest\r\n")));
        assert_eq!(status(&honest), 200);
        assert_eq!(status(&exchange(address, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")), 200);
        for (index, connection) in staying {
            assert!([200, 503].contains(&answer_to(connection)), "{index}");
        }
        drop(silent);
    });
}

/// Requests none of which is a good one.
fn malformed() -> Vec<Vec<u8>> {
    let body = br#"{"pose": {"rotations": {"jaw": [0.25, 0, 0]}}, "resolution": 64}"#;
    let valid = post(body, JSON);
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut requests: Vec<Vec<u8>> = Vec::new();
    requests.extend((0..60).map(|_| valid[..random.random_range(1..valid.len())].to_vec()));
    requests.extend((0..40).map(|_| {
        let length = random.random_range(1..400);
        (0..length).map(|_| random.random()).collect()
    }));
    // Without one of its brackets, quotes or colons the body is no JSON.
    let structure: Vec<usize> = (0..body.len()).filter(|place| b"{}[]\":".contains(&body[*place])).collect();
    requests.extend(structure.iter().map(|place| post(&[&body[..*place], &body[place + 1..]].concat(), JSON)));
    let bodies: [&[u8]; 22] = [
        b"",
        b"null",
        b"[]",
        b"{}",
        b"\xff\xfe\x00",
        br#"{"parameters": {}}"#,
        br#"{"parameters": {}, "resolution": null}"#,
        br#"{"parameters": {}, "resolution": "64"}"#,
        br#"{"parameters": {}, "resolution": 64.5}"#,
        br#"{"parameters": {}, "resolution": 0}"#,
        br#"{"parameters": {}, "resolution": 257}"#,
        br#"{"parameters": {}, "resolution": 1000000000000000000000}"#,
        br#"{"parameters": [], "resolution": -64}"#,
        br#"{"parameters": {"transl": [NaN, 0, 0]}, "resolution": 64}"#,
        br#"{"parameters": {"transl": [1e39, 0, 0]}, "resolution": 64}"#,
        br#"{"parameters": {"transl": [1e5, 0, 0]}, "resolution": 64}"#,
        br#"{"parameters": {"transl": [0, 0, 0, 0]}, "resolution": 64}"#,
        br#"{"parameters": {"transl": "here"}, "resolution": 64}"#,
        br#"{"parameters": {"body_pose": [[0, 0, 0]]}, "resolution": 64}"#,
        br#"{"parameters": {"unknown": 1}, "resolution": 64}"#,
        br#"{"parameters": {}, "resolution": 64, "more": {}}"#,
        br#"{"parameters": {}, "resolution": 64} trailing"#,
    ];
    requests.extend(bodies.iter().map(|body| post(body, JSON)));
    requests.push(post(&[b"[".repeat(60_000), b"1".to_vec()].concat(), JSON));
    let heads = [
        "GET\r\n\r\n".to_owned(),
        "GET / HTTP/3.0\r\nHost: localhost\r\n\r\n".into(),
        "GET nowhere HTTP/1.1\r\nHost: localhost\r\n\r\n".into(),
        "GET http://evil.example/ HTTP/1.1\r\nHost: localhost\r\n\r\n".into(),
        "GET /../../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n".into(),
        "GET /mesh HTTP/1.1\r\nHost: localhost\r\n\r\n".into(),
        "DELETE / HTTP/1.1\r\nHost: localhost\r\n\r\n".into(),
        "G\u{e9}T / HTTP/1.1\r\nHost: localhost\r\n\r\n".into(),
        "GET / HTTP/1.1\r\nHost localhost\r\n\r\n".into(),
        "GET / HTTP/1.1\r\nHost: localhost\r\n folded: yes\r\n\r\n".into(),
        "GET / HTTP/1.1\r\nHost: \u{0}\r\n\r\n".into(),
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".into(),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\n\r\n".into(),
        "GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n".into(),
        "GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://localhost\r\nOrigin: http://localhost\r\n\r\n".into(),
        "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n".into(),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n".into(),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\nContent-Length: +5\r\n\r\nhello".into(),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5, 5\r\n\r\nhello".into(),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\nhello!".into(),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999999999999999\r\n\r\n".into(),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\n".to_owned() + &"x".repeat(100_000),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nffffffff\r\n".into(),
        "POST /mesh HTTP/1.1\r\nHost: localhost\r\nExpect: 100-continue\r\nContent-Length: 9\r\n\r\n".into(),
        format!("GET /{} HTTP/1.1\r\nHost: localhost\r\n\r\n", "a".repeat(20_000)),
        format!("GET / HTTP/1.1\r\nHost: localhost\r\n{}\r\n", "Many: fields\r\n".repeat(200)),
        format!("GET / HTTP/1.1\r\nHost: localhost\r\nLong: {}\r\n\r\n", "b".repeat(1 << 20)),
    ];
    requests.extend(heads.map(String::into_bytes));
    // The rest: a good request in which one byte of the head's first line is not what it has to be.
    while requests.len() < 200 {
        let mut request = valid.clone();
        request[random.random_range(0..4)] = random.random_range(0x80..=0xff);
        requests.push(request);
    }
    requests
}

/// Resident memory of this process, bytes; none where the system does not say.
fn resident() -> Option<usize> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(4096 * text.split(' ').nth(1)?.parse::<usize>().ok()?)
}

#[test]
fn two_hundred_malformed_requests_get_a_4xx_and_cost_no_memory() {
    let requests = malformed();
    assert!(requests.len() >= 200);
    let site = site();
    serving(&site, |address| {
        let send_all = || {
            for request in &requests {
                let code = status(&exchange(address, request));
                let shown = String::from_utf8_lossy(&request[..request.len().min(300)]).into_owned();
                assert!((400..500).contains(&code), "{code} for {shown:?}");
            }
        };
        // The first round fills the allocator's pools; what a second adds is a leak.
        send_all();
        let before = resident();
        send_all();
        if let Some((before, after)) = before.zip(resident()) {
            let grown = after.saturating_sub(before);
            assert!(grown < 16 << 20, "{grown} bytes more after {} requests", requests.len());
        }
        let received = exchange(address, &post(br#"{"pose": {}, "resolution": 16}"#, JSON));
        assert_eq!(status(&received), 200, "alive, and still posing");
    });
}

// As `train --view` does: nothing is made before somebody asks, and then of the avatar as it is.
#[test]
fn a_trainings_page_is_made_when_somebody_asks() {
    let run = tempfile::tempdir().unwrap();
    let site = TrainingSite::new(run.path(), subject().model(), "a run".into(), "xavatar train".into());
    let get = |address| {
        let received = exchange(address, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
        assert_eq!(status(&received), 200);
        let (head, body) = head_and_body(&received);
        (head.to_lowercase(), String::from_utf8(body.to_vec()).unwrap())
    };
    std::thread::scope(|scope| {
        scope.spawn(|| site.make_pages());
        serving(&site, |address| {
            std::thread::sleep(Duration::from_millis(300));
            assert!(!site.wants_avatar(), "nobody has asked");
            let (head, body) = get(address);
            assert!(head.contains("refresh: 2") && body.contains("first page"), "{head}{body}");
            while !site.wants_avatar() {
                std::thread::sleep(Duration::from_millis(5));
            }
            assert!(!site.wants_avatar(), "one avatar is enough");
            site.give(untrained().clone());
            let page = loop {
                let (head, body) = get(address);
                if !head.contains("refresh") {
                    break body;
                }
                std::thread::sleep(Duration::from_millis(20));
            };
            assert!(page.contains("<title>a run</title>") && page.contains("data-viewer=\"canvas\""));
        });
        site.end();
    });
}
