//! Arrays with one row a frame, as [`smplx::Parameters`].

use glam::Vec3;

use crate::fields::{Fields, rotations};
use xavatar_body::smplx::{self, joint};
use xavatar_body::{Fingers, HandPose, Pose, PoseAxisAngle, Skeleton};
use xavatar_formats::{Array, ArrayData, Error, Result};

/// Takes columns from a file, all of T rows.
pub(super) struct FrameReader<'a> {
    fields: Fields<'a>,
    frames: usize,
    zeroed: Vec<String>,
}

impl<'a> FrameReader<'a> {
    /// A reader of as many frames as the array `key`, of `width` columns, has rows.
    pub(super) fn new(fields: Fields<'a>, key: &str, width: usize) -> Result<Self> {
        let frames = fields.rows(key, width)?.len() / width;
        if frames == 0 {
            return Err(fields.malformed(key, "no rows", "at least one frame"));
        }
        Ok(Self { fields, frames, zeroed: Vec::new() })
    }

    /// The rows of an array, one a frame; zeros, which are noted, if there is no such array.
    pub(super) fn rows<const WIDTH: usize>(&mut self, key: &str) -> Result<Vec<[f32; WIDTH]>> {
        let values = self.columns(key, WIDTH)?;
        Ok(values.map_or(vec![[0.0; WIDTH]; self.frames], |values| values.as_chunks().0.to_vec()))
    }

    /// A shape vector for all frames, (S) or (1, S), or one a frame, (T, S); the first coefficients of it, that are used.
    pub(super) fn betas(&mut self, key: &str) -> Result<Vec<Vec<f32>>> {
        let Some(array) = self.fields.arrays.get(key) else {
            self.zeroed.push(key.to_owned());
            return Ok(vec![Vec::new(); self.frames]);
        };
        let (rows, width) = match array.shape[..] {
            [width] => (1, width),
            [rows, width] => (rows, width),
            _ => (0, 0),
        };
        if width < smplx::SHAPES || (rows != 1 && rows != self.frames) {
            return Err(self.fields.malformed(
                key,
                array.description(),
                format_args!("{} or more shape coefficients", smplx::SHAPES),
            ));
        }
        let flat = Array { shape: vec![rows, width], data: array.data.clone() };
        let arrays = [(key.to_owned(), flat)].into();
        let values = Fields { arrays: &arrays, ..self.fields }.rows(key, width)?;
        let betas: Vec<Vec<f32>> = values.chunks_exact(width).map(|row| row[..smplx::SHAPES].to_vec()).collect();
        Ok(if rows == 1 { vec![betas[0].clone(); self.frames] } else { betas })
    }

    /// Hand poses of three rotation components a joint, in the convention that `pose` gives them.
    pub(super) fn hands(&mut self, key: &str, pose: fn(Fingers) -> HandPose) -> Result<Vec<HandPose>> {
        Ok(self.rows::<{ 3 * joint::HAND }>(key)?.iter().map(|components| pose(rotations(components))).collect())
    }

    /// Hand poses as PCA coefficients, as many as the array has columns.
    pub(super) fn pca_hands(&mut self, key: &str) -> Result<Vec<HandPose>> {
        let width = match self.fields.arrays.get(key).map(|array| &array.shape[..]) {
            None => {
                self.zeroed.push(key.to_owned());
                return Ok(vec![HandPose::Pca(Vec::new()); self.frames]);
            }
            Some(&[_, width]) if (1..=3 * joint::HAND).contains(&width) => width,
            Some(_) => {
                let expected = format_args!("1 to {} columns", 3 * joint::HAND);
                return Err(self.fields.malformed(key, self.fields.array(key)?.description(), expected));
            }
        };
        let values = self.columns(key, width)?.unwrap_or_default();
        Ok(values.chunks_exact(width).map(|row| HandPose::Pca(row.to_vec())).collect())
    }

    /// The frames of one array that holds all joints of a skeleton, three columns each in their order; hands relative to the flat
    /// hand. Joints that it does not have are at rest.
    pub(super) fn full_poses(&mut self, key: &str, skeleton: &Skeleton) -> Result<Vec<smplx::Parameters>> {
        let width = 3 * skeleton.joints.len();
        let values = self.columns(key, width)?.unwrap_or_else(|| vec![0.0; width * self.frames]);
        let turns = |row: &[f32]| row.as_chunks::<3>().0.iter().map(|turn| rotation(*turn)).collect();
        let pose = |row: &[f32]| {
            let pose = Pose { rotations: turns(row), ..Pose::default() };
            smplx::Parameters::from(&skeleton.transfer(&pose, smplx::skeleton()).pose)
        };
        Ok(values.chunks_exact(width).map(pose).collect())
    }

    /// The frame rate under the first of `keys` that is there.
    pub(super) fn frames_per_second(&self, keys: &[&str]) -> Result<Option<f32>> {
        let Some(key) = keys.iter().find(|key| self.fields.arrays.contains_key(**key)) else { return Ok(None) };
        match self.fields.number(key)? {
            rate if rate > 0.0 => Ok(Some(rate)),
            rate => Err(self.fields.malformed(key, rate, "a positive number of frames a second")),
        }
    }

    /// Text under `key`, if it is there.
    pub(super) fn text(&self, key: &str) -> Result<Option<&'a str>> {
        match self.fields.arrays.get(key) {
            None => Ok(None),
            Some(Array { data: ArrayData::Text(text), .. }) => Ok(Some(text)),
            Some(array) => Err(self.fields.malformed(key, array.description(), "text")),
        }
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.fields.arrays.contains_key(key)
    }

    pub(super) fn malformed(&self, key: &str, found: impl ToString, expected: impl ToString) -> Error {
        self.fields.malformed(key, found, expected)
    }

    /// The names of the parameters that were not there.
    pub(super) fn zeroed(self) -> Vec<String> {
        self.zeroed
    }

    fn columns(&mut self, key: &str, width: usize) -> Result<Option<Vec<f32>>> {
        if !self.has(key) {
            self.zeroed.push(key.to_owned());
            return Ok(None);
        }
        let values = self.fields.rows(key, width)?;
        if values.len() != self.frames * width {
            let expected = format!("{} frames, as many as the other arrays", self.frames);
            return Err(self.malformed(key, format_args!("{} rows", values.len() / width), expected));
        }
        Ok(Some(values))
    }
}

/// A rotation from its components.
pub(super) fn rotation(components: [f32; 3]) -> PoseAxisAngle {
    PoseAxisAngle(Vec3::from(components))
}
