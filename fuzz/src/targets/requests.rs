//! What browsers and programs send to `xavatar view`, and what it sends back.

use xavatar::view::{PoseRequest, Request, decode_mesh};

pub(super) fn request(bytes: &[u8]) -> bool {
    Request::parse(bytes).is_ok_and(|request| request.is_some())
}

pub(super) fn request_seeds() -> Vec<Vec<u8>> {
    vec![
        b"GET /?from=bookmark HTTP/1.1\r\nHost: localhost:80\r\nAccept: */*\r\n\r\n".to_vec(),
        b"POST /mesh HTTP/1.1\r\nHost: [::1]:8383\r\nOrigin: http://[::1]:8383\r\nContent-Length: 2\r\n\r\n{}".to_vec(),
    ]
}

pub(super) fn pose(bytes: &[u8]) -> bool {
    PoseRequest::parse(bytes).is_ok()
}

pub(super) fn pose_seeds() -> Vec<Vec<u8>> {
    vec![
        br#"{"pose": {}, "resolution": 64}"#.to_vec(),
        br#"{"pose": {"rotations": {"jaw": [0.2, 0, 0]}, "translation": [0, 1, 0], "expression": [0,0,0,0,0,0,0,0,0,1.5]}, "resolution": 128}"#
            .to_vec(),
    ]
}

pub(super) fn mesh_message(bytes: &[u8]) -> bool {
    decode_mesh(bytes).is_ok()
}

pub(super) fn mesh_message_seeds() -> Vec<Vec<u8>> {
    let head = [1u32, 1, 64, 0].map(u32::to_le_bytes).concat();
    vec![[&head[..], &[0; 24], &[200; 4], &[0; 12]].concat()]
}
