//! The built-in subject, and an avatar of it that was never trained: what poses, pages and requests can be tried on at once.

use std::sync::OnceLock;

use glam::Vec3;
use xavatar::avatar::{Avatar, Subject};
use xavatar::body::Gender;
use xavatar::config::{Config, SkinningSettings};
use xavatar::fields::{Fields, Skinning};
use xavatar::synthetic::BuiltInSubject;

/// The built-in subject, made once.
pub fn subject() -> &'static BuiltInSubject {
    static SUBJECT: OnceLock<BuiltInSubject> = OnceLock::new();
    SUBJECT.get_or_init(|| BuiltInSubject::new().unwrap())
}

/// The paper's networks, but small.
pub fn small_networks() -> Config {
    let small = [
        ("fields.geometry.width", "48"),
        ("fields.geometry.frequencies", "2"),
        ("fields.texture.width", "32"),
        ("fields.texture.frequencies", "1"),
        ("fields.skinning.width", "32"),
    ];
    let settings: Vec<_> = small.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
    Config::preset_with("paper-scan", &settings).unwrap()
}

/// Fields that nothing was trained of: a ball, with the skinning weights that chance gave it.
pub fn untrained() -> Avatar {
    let config = small_networks();
    // Larger than the ball, so that its surface is not cut off.
    let bounds = (Vec3::splat(-1.3), Vec3::splat(1.3));
    let SkinningSettings::Network(shape) = &config.fields.skinning else { unreachable!("a paper preset") };
    let subject = Subject::of(subject().model(), Gender::Neutral, subject().betas(), bounds, 0).unwrap();
    let skinning = Skinning::network(shape, &subject.skeleton).unwrap();
    let mut fields = Fields::new(&config.fields, &subject.condition(), skinning, bounds).unwrap();
    fields.initialise(5);
    Avatar { fields, config, subject, steps: 0 }
}
