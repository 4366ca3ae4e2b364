//! Captures as arrays: how a run's cache stores them, whatever format they came in; one file a kind.

mod parameters;
mod rgbd;
mod scan;

use std::path::Path;

use glam::Vec3;

use crate::data::{Capture, FrameId};
use crate::formats::{Array, ArrayData, ArrayMap, Error, Result, read_npz, write_npz};

/// Writes a capture whose pose is resolved.
pub(super) fn write(path: &Path, capture: &Capture) -> Result<()> {
    let mut arrays = match capture {
        Capture::Scan(frame) => scan::to_arrays(frame),
        Capture::Rgbd(capture) => rgbd::to_arrays(capture),
    };
    parameters::insert(&mut arrays, &capture.parameters().absolute()?);
    write_npz(path, &arrays)
}

/// Reads a capture that [`write`] wrote.
pub(super) fn read(path: &Path, id: &FrameId) -> Result<Capture> {
    let read = || {
        let arrays = read_npz(path)?;
        let stored = Stored { path, arrays: &arrays };
        let parameters = parameters::of(&stored)?.into();
        Ok(match arrays.contains_key(rgbd::CAMERA) {
            true => Capture::Rgbd(Box::new(rgbd::of(&stored, id.clone(), parameters)?)),
            false => Capture::Scan(Box::new(scan::of(&stored, id.clone(), parameters)?)),
        })
    };
    read().map_err(|error: Error| error.in_frame(id.to_string()))
}

/// The arrays of a stored frame.
struct Stored<'a> {
    path: &'a Path,
    arrays: &'a ArrayMap,
}

impl Stored<'_> {
    fn has(&self, key: &str) -> bool {
        self.arrays.contains_key(key)
    }

    fn broken(&self, key: &str) -> Error {
        Error::Malformed {
            path: self.path.into(),
            format: "cached frame",
            place: format!("`{key}`"),
            found: self.arrays.get(key).map_or("absent".into(), Array::description),
            expected: "what the frame was stored with; delete the run's cache folder and resume".into(),
        }
    }

    fn array(&self, key: &str) -> Result<&Array> {
        self.arrays.get(key).ok_or_else(|| self.broken(key))
    }

    fn floats(&self, key: &str) -> Result<Vec<f32>> {
        self.array(key)?.to_f32().ok_or_else(|| self.broken(key))
    }

    fn exactly<const N: usize>(&self, key: &str) -> Result<[f32; N]> {
        <[f32; N]>::try_from(self.floats(key)?).map_err(|_| self.broken(key))
    }

    fn points(&self, key: &str) -> Result<Vec<Vec3>> {
        Ok(self.floats(key)?.as_chunks().0.iter().copied().map(Vec3::from_array).collect())
    }

    fn bytes(&self, key: &str) -> Result<&[u8]> {
        match &self.array(key)?.data {
            ArrayData::U8(bytes) => Ok(bytes),
            _ => Err(self.broken(key)),
        }
    }

    fn indices(&self, key: &str, length: usize) -> Result<Vec<u32>> {
        self.array(key)?.to_indices(length).ok_or_else(|| self.broken(key))
    }

    fn picture(&self, key: &str) -> Result<image::RgbImage> {
        let [height, width, 3] = self.array(key)?.shape[..] else { return Err(self.broken(key)) };
        let picture = image::RgbImage::from_raw(width as u32, height as u32, self.bytes(key)?.to_vec());
        picture.ok_or_else(|| self.broken(key))
    }
}

fn rows(values: impl IntoIterator<Item = Vec3>) -> Array {
    let flat: Vec<f32> = values.into_iter().flat_map(|value| value.to_array()).collect();
    Array::from_f32(&[flat.len() / 3, 3], flat)
}

fn picture_array(picture: &image::RgbImage) -> Array {
    let shape = vec![picture.height() as usize, picture.width() as usize, 3];
    Array { shape, data: ArrayData::U8(picture.as_raw().clone()) }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec2;
    use image::{Rgb, RgbImage};

    use super::*;
    use crate::body::{BodyParameters, smplx};
    use crate::data::{BACKGROUND, RgbdCapture, RgbdFrame, ScanFrame};
    use crate::mesh::camera::PinholeCamera;
    use crate::mesh::{Colouring, TriangleMesh};

    fn id() -> FrameId {
        FrameId { split: "train".into(), sequence: "Take1".into(), number: 7 }
    }

    fn parameters() -> BodyParameters {
        let mut pose = smplx::skeleton().canonical_pose(&[0.5, -1.0]);
        pose.rotations[21].0 = Vec3::new(0.1, 0.2, 0.3);
        pose.expression = vec![0.25; 3];
        pose.translation = Vec3::new(1.0, 2.0, 3.0);
        pose.into()
    }

    fn read_back(frame: &Capture) -> Capture {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.npz");
        write(&path, frame).unwrap();
        read(&path, frame.id()).unwrap()
    }

    #[test]
    fn a_stored_scan_is_the_scan() {
        let image = RgbImage::from_fn(4, 3, |x, y| Rgb([x as u8, y as u8, 7]));
        let scan = TriangleMesh {
            vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            faces: vec![[0, 1, 2]],
            normals: Some(vec![Vec3::Z; 3]),
            colouring: Colouring::Texture { uvs: vec![Vec2::new(0.25, 0.5); 3], image: Arc::new(image) },
        };
        let unseen_parts = vec!["left_hand".to_owned()];
        let frame = ScanFrame { id: id(), scan, parameters: parameters(), unseen_parts, notes: Vec::new() };
        let Capture::Scan(read) = read_back(&Capture::Scan(Box::new(frame.clone()))) else { panic!("not a scan") };
        assert_eq!(format!("{read:?}"), format!("{frame:?}"));
    }

    // A tilted square before an open background, with pixels that measured nothing.
    #[test]
    fn a_stored_picture_is_the_picture_around_the_subject() {
        let camera = PinholeCamera::looking_at(Vec3::new(0.5, 1.0, 3.0), Vec3::Y, 0.5, [300, 400]).unwrap();
        let depth = |pixel: u32| match (pixel % 300, pixel / 300) {
            (150..180, 200..260) if pixel.is_multiple_of(97) => 0.0,
            (column @ 150..180, 200..260) => 3.0 + 0.001 * column as f32,
            _ => BACKGROUND,
        };
        let frame = RgbdFrame {
            id: id(),
            camera,
            colour: RgbImage::from_fn(300, 400, |column, row| Rgb([column as u8, row as u8, 7])),
            depth: (0..300 * 400).map(depth).collect(),
            mask: Some(vec![true; 300 * 400]),
            parameters: parameters(),
        };
        let whole = crate::data::PointCloud::of(&frame).unwrap();
        let capture = RgbdCapture::of(frame.clone()).unwrap();
        assert!(capture.frame.depth.len() < frame.depth.len() / 2);
        assert_eq!((&capture.cloud.points, &capture.cloud.colours), (&whole.points, &whole.colours));
        for (point, pixel) in capture.cloud.points.iter().zip(&capture.cloud.pixels) {
            let (place, depth) = capture.frame.camera.project(*point);
            assert_eq!(place.y as u32 * capture.frame.camera.width + place.x as u32, *pixel);
            assert!((depth - capture.frame.depth[*pixel as usize]).abs() < 1e-5);
        }
        let read = read_back(&Capture::Rgbd(Box::new(capture.clone())));
        let Capture::Rgbd(read) = read else { panic!("not a picture") };
        assert_eq!(format!("{:?}", read.frame), format!("{:?}", capture.frame));
        assert_eq!((&read.cloud.normals, &read.cloud.pixels), (&capture.cloud.normals, &capture.cloud.pixels));
        let near = |(a, b): (&Vec3, &Vec3)| a.abs_diff_eq(*b, 1e-5);
        assert!(read.cloud.points.iter().zip(&capture.cloud.points).all(near));
    }
}
