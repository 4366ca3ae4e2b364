//! `xavatar.Body`: a body model of any family.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use xavatar::body::{BodyModel, Coefficients, Gender, PartLabels, Skeleton};
use xavatar::synthetic::BuiltInSubject;

use crate::arrays::{array_of_points, array_of_rows};
use crate::errors::Raise;
use crate::posed_bodies::PosedBodies;

/// A body model: SMPL-X, SMPL+H, SMPL, STAR, SUPR, MANO, FLAME. B frames, V vertices, J joints, K coefficients; metres, radians, Y up.
///
/// ``body(betas=..., body_pose=..., ...)`` poses it by the arguments of PyPI smplx; ``body.forward`` by arrays of all joints.
#[pyclass(frozen, module = "xavatar")]
#[derive(Clone)]
pub struct Body {
    pub(crate) model: Arc<BodyModel>,
    pub(crate) labels: Arc<PartLabels>,
}

impl Body {
    /// A model with the part labels beside its file.
    pub fn of(model: BodyModel) -> xavatar::Result<Self> {
        let labels = PartLabels::find(&model)?;
        Ok(Self { model: Arc::new(model), labels: Arc::new(labels) })
    }

    /// The model of a gender, from a file or a folder.
    pub fn read(path: &std::path::Path, gender: Gender) -> xavatar::Result<Self> {
        Self::of(BodyModel::load(path, gender)?)
    }

    /// The built-in subject's.
    pub fn of_built_in_subject() -> xavatar::Result<Self> {
        let subject = BuiltInSubject::new()?;
        Ok(Self { model: Arc::new(subject.model().clone()), labels: Arc::new(subject.part_labels().clone()) })
    }
}

#[pymethods]
impl Body {
    /// Reads a model's file, or the ``{FAMILY}_{GENDER}.npz`` or ``.pkl`` of a folder.
    ///
    /// ``all_coefficients`` takes every coefficient of shape and expression that the file has, instead of the first ten.
    #[staticmethod]
    #[pyo3(signature = (path, gender = "neutral", all_coefficients = false))]
    fn load(py: Python<'_>, path: PathBuf, gender: &str, all_coefficients: bool) -> PyResult<Self> {
        let gender: Gender = gender.parse().or_raise()?;
        py.detach(|| {
            let model = BodyModel::load(&path, gender)?;
            if !all_coefficients {
                return Self::of(model);
            }
            let file = model.path();
            Self::of(BodyModel::from_arrays_with(file, &BodyModel::read_arrays(file)?, Coefficients::All)?)
        })
        .or_raise()
    }

    /// The body of the built-in subject, in the format of SMPL-X; takes no file.
    #[staticmethod]
    fn built_in(py: Python<'_>) -> PyResult<Self> {
        py.detach(Self::of_built_in_subject).or_raise()
    }

    /// The family: ``"SMPL-X"``.
    #[getter]
    fn family(&self) -> &str {
        &self.skeleton().family
    }

    /// The joints' names (J).
    #[getter]
    fn joints(&self) -> Vec<String> {
        self.skeleton().joints.clone()
    }

    /// The place of each joint's parent (J), -1 for the root.
    #[getter]
    fn parents<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        parents(self.skeleton()).into_pyarray(py)
    }

    /// Corners of the faces (F, 3), uint32.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        array_of_rows(py, self.model.faces().to_vec())
    }

    /// Vertices of the mean shape at rest (V, 3), metres.
    #[getter]
    fn template<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        array_of_points(py, self.model.template().to_vec())
    }

    /// Skinning weights (V, J); each row sums to 1.
    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let size = [self.model.vertex_count(), self.skeleton().joints.len()];
        self.model.skinning_weights().to_vec().into_pyarray(py).reshape(size)
    }

    /// How many coefficients of shape there are: the first of K.
    #[getter]
    fn shape_coefficients(&self) -> usize {
        self.model.shape_coefficients()
    }

    /// How many coefficients of expression there are: the last of K.
    #[getter]
    fn expression_coefficients(&self) -> usize {
        self.model.expression_coefficients()
    }

    /// The relaxed hands (hands, 45), axis-angle: left and right, one for MANO, none for bodies without hand conventions.
    #[getter]
    fn hand_means<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        array_of_rows(py, self.model.hands().iter().map(|hand| hand.mean).collect())
    }

    /// The principal components of the hands' poses (hands, components, 45).
    #[getter]
    fn hand_components<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let hands = self.model.hands();
        let components: Vec<[f32; 45]> = hands.iter().flat_map(|hand| hand.components.iter().copied()).collect();
        crate::arrays::array_of_frames(py, components, hands.len())
    }

    /// Poses a batch of bodies.
    ///
    /// ``rotations`` (B, J, 3) are the joints' axis-angles, absolute: zero is the flat hand. ``coefficients`` (B, K) are those of shape,
    /// then of expression; ``translations`` (B, 3) are added to vertices and joints. What is left out is zero. Computed in float64 if
    /// ``rotations`` is that, else in float32.
    #[pyo3(signature = (rotations, coefficients = None, translations = None))]
    fn forward(
        &self,
        rotations: &Bound<'_, PyAny>,
        coefficients: Option<&Bound<'_, PyAny>>,
        translations: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PosedBodies> {
        PosedBodies::of(self.model.clone(), rotations, coefficients, translations)
    }

    /// Poses a batch of bodies by the arguments of PyPI smplx, numpy arrays or torch tensors (B, n); see ``xavatar.smplx``.
    #[pyo3(signature = (**parameters))]
    fn __call__<'py>(slf: &Bound<'py, Self>, parameters: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        let layer = slf.py().import("xavatar.smplx")?.getattr("BodyLayer")?.call1((slf,))?;
        layer.call((), parameters)
    }

    fn __repr__(&self) -> String {
        format!("<xavatar.Body of {}, {} vertices>", self.skeleton().description(), self.model.vertex_count())
    }
}

impl Body {
    fn skeleton(&self) -> &Skeleton {
        self.model.skeleton()
    }
}

/// The place of each joint's parent (J), -1 for the root.
pub fn parents(skeleton: &Skeleton) -> Vec<i64> {
    skeleton.parents.iter().map(|parent| parent.map_or(-1, |parent| parent as i64)).collect()
}
