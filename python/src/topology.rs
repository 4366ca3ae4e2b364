//! `xavatar.FixedTopology`: one canonical mesh, skinned from pose to pose.

use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use xavatar::avatar;
use xavatar::body::Skeleton;

use crate::body::Body;
use crate::errors::Raise;
use crate::meshes::python_mesh;
use crate::poses::pose_of;

/// One canonical mesh of an avatar that is skinned from pose to pose: fast, with the same faces in every frame. What a pose hides is still
/// in the mesh; for pictures and metrics take ``Avatar.pose``.
#[pyclass(frozen, module = "xavatar")]
pub struct FixedTopology {
    topology: avatar::FixedTopology,
    skeleton: Skeleton,
}

impl FixedTopology {
    /// An avatar's, on a body.
    pub fn new(avatar: &avatar::Avatar, body: &Body, resolution: usize) -> xavatar::Result<Self> {
        let topology = avatar::FixedTopology::new(avatar, &body.model, resolution)?;
        Ok(Self { topology, skeleton: avatar.subject.skeleton.clone() })
    }
}

#[pymethods]
impl FixedTopology {
    /// The mesh in a pose: an ``xavatar.Mesh`` with the faces and colours of the canonical one.
    #[pyo3(signature = (pose = None))]
    fn pose<'py>(&self, py: Python<'py>, pose: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let pose = pose_of(pose, &self.skeleton)?;
        let mesh = py.detach(|| self.topology.pose(&pose)).or_raise()?;
        python_mesh(py, mesh)
    }

    /// The canonical mesh: an ``xavatar.Mesh``.
    #[getter]
    fn canonical<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python_mesh(py, self.topology.canonical().clone())
    }

    /// Skinning weights of its vertices (V, J); each row sums to 1.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let weights = self.topology.weights().to_vec();
        let joints = self.skeleton.joints.len();
        let vertices = weights.len() / joints;
        weights.into_pyarray(py).reshape([vertices, joints])
    }
}
