//! The stages of a fit: what each solves for, and how it weighs scan and landmarks (thesis A.1, with clothing learned in between).
//!
//! From landmarks alone to a tight fit: reach and deviation shrink, landmarks fade. Lengths in metres.

use crate::linear::Besides;
use crate::target::Seekers;
use crate::terms::{LandmarkTerm, SurfaceTerm};

/// The joints that a stage turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freed {
    /// The root, limbs, spine, neck and head.
    Body,
    /// Shoulders, elbows and wrists.
    Arms,
    /// Wrists and fingers.
    Hands,
    /// Neck, head and jaw.
    Face,
    /// All but the eyes.
    All,
}

/// Limbs that are tried in several ways after a stage, since no small step leads from one to the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limbs {
    /// Rolled and bent otherwise.
    Arms,
    /// Turned, and with other fingers bent.
    Hands,
}

/// One stage.
#[derive(Clone, Copy, Debug)]
pub struct Stage {
    /// For people.
    pub name: &'static str,
    /// Joints that it turns.
    pub freed: Freed,
    /// What else it solves for.
    pub besides: Besides,
    /// Steps that it takes.
    pub steps: usize,
    /// The scan, if it looks at it.
    pub surface: Option<SurfaceTerm>,
    /// Landmarks, if it looks at them.
    pub landmarks: Option<LandmarkTerm>,
    /// What a shape coefficient of 1 costs, a frame.
    pub shape_prior: f64,
    /// What an expression coefficient of 1 costs.
    pub expression_prior: f64,
    /// What is tried after it.
    pub settled: Option<Limbs>,
}

const fn surface(normal_weight: f64, reach: f64, deviation: f64) -> Option<SurfaceTerm> {
    Some(SurfaceTerm { normal_weight, reach, deviation, seekers: Seekers::All, along: 0.0 })
}

const fn landmarks(deviation: f64, reach: f64, with_vertices: bool) -> Option<LandmarkTerm> {
    Some(LandmarkTerm { deviation, reach, with_vertices })
}

const MOVED: Besides = Besides { translation: true, expression: false, shape: false };
const SHAPED: Besides = Besides { translation: true, expression: false, shape: true };
const STILL: Besides = Besides { translation: false, expression: false, shape: false };
const EXPRESSED: Besides = Besides { translation: false, expression: true, shape: false };

const BASIS: Stage = Stage {
    name: "",
    freed: Freed::Body,
    besides: MOVED,
    steps: 0,
    surface: None,
    landmarks: None,
    // Cloth is no independent noise: the mean shape has to count.
    shape_prior: 8.0,
    expression_prior: 0.3,
    settled: None,
};

/// From landmarks alone.
pub const FROM_LANDMARKS: [Stage; 3] = [
    Stage { name: "body, landmarks", steps: 7, landmarks: landmarks(0.02, 0.3, false), ..BASIS },
    Stage {
        name: "shape, landmarks",
        besides: SHAPED,
        steps: 4,
        landmarks: landmarks(0.02, 0.12, false),
        shape_prior: 60.0,
        ..BASIS
    },
    Stage {
        name: "hands, landmarks",
        freed: Freed::Hands,
        besides: STILL,
        steps: 4,
        landmarks: landmarks(0.008, 0.05, true),
        ..BASIS
    },
];

/// From a guess or from another frame's pose: bodies that are far from the scan find their way to it, along it too.
pub const COARSE: [Stage; 2] = [
    Stage {
        name: "body, far from the scan",
        besides: SHAPED,
        steps: 8,
        surface: Some(SurfaceTerm {
            normal_weight: 0.15,
            reach: 0.3,
            deviation: 0.03,
            seekers: Seekers::Few,
            along: 0.3,
        }),
        landmarks: landmarks(0.03, 0.3, false),
        shape_prior: 5.0,
        ..BASIS
    },
    Stage {
        name: "body, nearer",
        besides: SHAPED,
        steps: 8,
        surface: Some(SurfaceTerm {
            normal_weight: 0.08,
            reach: 0.12,
            deviation: 0.02,
            seekers: Seekers::Few,
            along: 0.1,
        }),
        landmarks: landmarks(0.03, 0.12, false),
        shape_prior: 3.0,
        ..BASIS
    },
];

/// From scan and landmarks, with clothing of an assumed thickness.
pub const STAGES: [Stage; 4] = [
    Stage {
        name: "body, scan",
        besides: SHAPED,
        steps: 4,
        surface: surface(0.08, 0.09, 0.015),
        landmarks: landmarks(0.03, 0.06, true),
        ..BASIS
    },
    Stage {
        name: "body, scan near",
        besides: SHAPED,
        steps: 4,
        surface: surface(0.04, 0.04, 0.008),
        landmarks: landmarks(0.05, 0.06, true),
        settled: Some(Limbs::Arms),
        ..BASIS
    },
    Stage {
        name: "hands, scan",
        freed: Freed::Hands,
        besides: STILL,
        steps: 5,
        surface: surface(0.04, 0.02, 0.004),
        landmarks: landmarks(0.015, 0.04, true),
        settled: Some(Limbs::Hands),
        ..BASIS
    },
    Stage {
        name: "face, scan",
        freed: Freed::Face,
        besides: EXPRESSED,
        steps: 4,
        surface: surface(0.02, 0.015, 0.003),
        landmarks: landmarks(0.03, 0.03, true),
        expression_prior: 0.5,
        ..BASIS
    },
];

/// With the clothing as learned, again and again.
pub const DRESSED: Stage = Stage {
    name: "all, clothing",
    freed: Freed::All,
    besides: Besides { translation: true, expression: true, shape: true },
    steps: 3,
    surface: surface(0.03, 0.012, 0.003),
    landmarks: landmarks(0.3, 0.04, true),
    ..BASIS
};

/// The same of what one camera saw: the rest hangs on its landmarks to the end.
pub const DRESSED_IN_PART: Stage = Stage { landmarks: landmarks(0.03, 0.08, true), ..DRESSED };

/// Rounds of learning clothing and fitting with it.
pub const ROUNDS: usize = 6;
