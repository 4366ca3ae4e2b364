//! Meshes between files, the library and `xavatar.Mesh`.

use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec2;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use xavatar::mesh::{Colouring, TriangleMesh, write_ply};

use crate::arrays::{Numbers, array_of_points, array_of_rows, points};
use crate::errors::Raise;
use crate::python_classes;

/// The mesh as an `xavatar.Mesh`, which takes over its arrays.
pub fn python_mesh(py: Python<'_>, mesh: TriangleMesh) -> PyResult<Bound<'_, PyAny>> {
    let TriangleMesh { vertices, faces, normals, colouring } = mesh;
    let vertices = array_of_points(py, vertices)?;
    let faces = array_of_rows(py, faces)?;
    let normals = normals.map(|normals| array_of_points(py, normals)).transpose()?;
    let (colours, uvs, texture) = match colouring {
        Colouring::None => (None, None, None),
        Colouring::Vertex(colours) => (Some(array_of_rows(py, colours)?), None, None),
        Colouring::Texture { uvs, image } => {
            let size = [image.height() as usize, image.width() as usize, 3];
            let texture = PyArray1::from_vec(py, Arc::unwrap_or_clone(image).into_raw()).reshape(size)?;
            (None, Some(array_of_rows(py, uvs.iter().map(Vec2::to_array).collect())?), Some(texture))
        }
    };
    python_classes::mesh(py)?.call1((vertices, faces, normals, colours, uvs, texture))
}

/// Reads the mesh in a PLY, OBJ or GLB file, with its colours or its texture.
#[pyfunction]
pub fn read_mesh(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let read = py.detach(|| xavatar::mesh::read_mesh(&path)).or_raise()?;
    python_mesh(py, read.mesh)
}

/// Writes vertices (V, 3), faces (F, 3), normals (V, 3) and colours (V, 3) as a PLY file.
#[pyfunction]
pub fn write_mesh(
    py: Python<'_>,
    path: PathBuf,
    vertices: &Bound<'_, PyAny>,
    faces: &Bound<'_, PyAny>,
    normals: Option<&Bound<'_, PyAny>>,
    colours: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let colours = colours.map(|colours| Numbers::<u8>::of(colours)?.rows("colours").map(<[_]>::to_vec)).transpose()?;
    let mesh = TriangleMesh {
        vertices: points("vertices", vertices)?,
        faces: Numbers::of(faces)?.rows("faces")?.to_vec(),
        normals: normals.map(|normals| points("normals", normals)).transpose()?,
        colouring: colours.map_or(Colouring::None, Colouring::Vertex),
    };
    py.detach(|| write_ply(&path, &mesh)).or_raise()
}
