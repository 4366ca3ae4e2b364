//! `xavatar.Avatar`: a trained avatar with its body model, made ready for many poses when the first is asked for.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use self_cell::self_cell;
use xavatar::avatar::{Animator, Sample};
use xavatar::body::{Pose, Skeleton};
use xavatar::formats::Remedy;
use xavatar::{Error, InputError};

use crate::arrays::{array_of_points, array_of_rows, points};
use crate::body::{Body, parents};
use crate::errors::Raise;
use crate::meshes::python_mesh;
use crate::poses::{pose_of, python_pose};
use crate::python_classes;
use crate::topology::FixedTopology;

/// An animatable avatar. V vertices, F faces, J joints; metres, radians, Y up, facing +Z.
///
/// A pose is an ``xavatar.Pose``, an array of axis-angles (J, 3), or a dictionary of them by joints' names; joints that are left out do
/// not turn. The shape is always the avatar's own.
#[pyclass(frozen, module = "xavatar")]
pub struct Avatar {
    avatar: Arc<xavatar::avatar::Avatar>,
    path: PathBuf,
    /// As given; else, once it is needed, the built-in subject's, if the avatar is of that.
    body: Mutex<Option<Body>>,
    animator: Mutex<Option<Arc<OwnedAnimator>>>,
}

/// What an animator borrows.
struct Animated {
    avatar: Arc<xavatar::avatar::Avatar>,
    body: Body,
}

self_cell! {
    /// An animator with what it borrows.
    struct OwnedAnimator {
        owner: Animated,
        #[covariant]
        dependent: Animator,
    }
}

impl Avatar {
    /// The avatar in a file or a run's folder, posed by `body` where one is given.
    pub fn read(path: PathBuf, body: Option<Body>) -> xavatar::Result<Self> {
        let avatar = Arc::new(xavatar::avatar::Avatar::load(&path)?);
        Ok(Self { avatar, path, body: Mutex::new(body), animator: Mutex::default() })
    }

    /// The library's.
    pub fn avatar(&self) -> &xavatar::avatar::Avatar {
        &self.avatar
    }

    fn skeleton(&self) -> &Skeleton {
        &self.avatar.subject.skeleton
    }

    /// The body that poses it.
    pub fn body_model(&self) -> xavatar::Result<Body> {
        let mut body = self.body.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(body) = &*body {
            return Ok(body.clone());
        }
        let built_in = Body::of_built_in_subject()?;
        if !self.avatar.subject.is_on(&built_in.model)? {
            return Err(Error::from(InputError::Missing {
                path: self.path.clone(),
                what: "the body model that poses the avatar".into(),
                remedy: Remedy::from("give it: xavatar.load(path, body=FILE or FOLDER)"),
            }));
        }
        Ok(body.insert(built_in).clone())
    }

    fn animator(&self) -> xavatar::Result<Arc<OwnedAnimator>> {
        let mut animator = self.animator.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(animator) = &*animator {
            return Ok(animator.clone());
        }
        let animated = Animated { avatar: self.avatar.clone(), body: self.body_model()? };
        let made = OwnedAnimator::try_new(animated, |Animated { avatar, body }| {
            Animator::new(avatar, &body.model, &body.labels)
        })?;
        Ok(animator.insert(Arc::new(made)).clone())
    }
}

#[pymethods]
impl Avatar {
    /// Reads an ``avatar.safetensors`` or the one in a run's folder.
    ///
    /// ``body`` is the body model that poses it: an ``xavatar.Body``, a file, or a folder of models, of which the avatar's gender
    /// chooses. The built-in subject's avatars need none.
    #[staticmethod]
    #[pyo3(signature = (path, body = None))]
    fn load(py: Python<'_>, path: PathBuf, body: Option<BodyArgument>) -> PyResult<Self> {
        py.detach(|| {
            let avatar = Self::read(path, None)?;
            let body = body.map(|body| body.read(avatar.avatar.subject.gender)).transpose()?;
            if let Some(body) = &body {
                avatar.skeleton().require(body.model.skeleton(), "the body model")?;
            }
            *avatar.body.lock().unwrap_or_else(PoisonError::into_inner) = body;
            Ok::<_, Error>(avatar)
        })
        .or_raise()
    }

    /// Writes the avatar as one file.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.avatar.save(&path)).or_raise()
    }

    /// The surface in a pose: an ``xavatar.Mesh`` without hidden surfaces, in the world, with normals and colours.
    ///
    /// ``resolution`` is the number of cells along the longest side of the box around the posed body. The first call prepares what
    /// all poses share and takes longer.
    #[pyo3(signature = (pose = None, resolution = 128))]
    fn pose<'py>(
        &self,
        py: Python<'py>,
        pose: Option<&Bound<'py, PyAny>>,
        resolution: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pose = pose_of(pose, self.skeleton())?;
        let extract = || self.animator()?.borrow_dependent().extract(&pose, resolution);
        python_mesh(py, py.detach(extract).or_raise()?.mesh)
    }

    /// The canonical surface, under the condition of a pose or under none: an ``xavatar.Mesh``.
    #[pyo3(signature = (resolution = 128, pose = None))]
    fn canonical<'py>(
        &self,
        py: Python<'py>,
        resolution: usize,
        pose: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pose = pose.map(|pose| pose_of(Some(pose), self.skeleton())).transpose()?;
        let extract = || match &pose {
            Some(pose) => self.avatar.extract_canonical(pose, resolution),
            None => self.avatar.extract_unconditioned(resolution),
        };
        python_mesh(py, py.detach(extract).or_raise()?.mesh)
    }

    /// One canonical mesh that is skinned from pose to pose: fast, with the same faces in every frame.
    #[pyo3(signature = (resolution = 128))]
    fn fixed_topology(&self, py: Python<'_>, resolution: usize) -> PyResult<FixedTopology> {
        py.detach(|| FixedTopology::new(&self.avatar, &self.body_model()?, resolution)).or_raise()
    }

    /// What the fields say of canonical points (N, 3), under a pose: an ``xavatar.Samples``.
    #[pyo3(signature = (points, pose = None))]
    fn query<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = given_points)] points: Vec<glam::Vec3>,
        pose: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let pose = pose_of(pose, self.skeleton())?;
        let samples = py.detach(|| self.avatar.query(&points, &pose)).or_raise()?;
        python_samples(py, samples, self.skeleton().joints.len())
    }

    /// The pose at rest: no joint is turned.
    fn rest_pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.own_pose(py, self.skeleton().rest_pose())
    }

    /// The pose of canonical space.
    fn canonical_pose<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.own_pose(py, self.skeleton().canonical_pose(&self.avatar.subject.betas))
    }

    /// The body model that poses it.
    #[getter]
    fn body(&self, py: Python<'_>) -> PyResult<Body> {
        py.detach(|| self.body_model()).or_raise()
    }

    /// The family of its skeleton: ``"SMPL-X"``.
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

    /// Where the joints are in canonical space (J, 3), metres.
    #[getter]
    fn canonical_joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        array_of_points(py, self.avatar.subject.joints.clone())
    }

    /// Where the joints are at rest (J, 3), metres.
    #[getter]
    fn rest_joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        array_of_points(py, self.skeleton().at_rest(&self.avatar.subject.joints))
    }

    /// The lowest and the highest corner of the canonical box (2, 3), metres.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (lowest, highest) = self.avatar.subject.bounds;
        array_of_points(py, vec![lowest, highest])
    }

    /// The subject's shape coefficients.
    #[getter]
    fn betas<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        self.avatar.subject.betas.clone().into_pyarray(py)
    }

    /// ``"neutral"``, ``"female"`` or ``"male"``: which body model it is of.
    #[getter]
    fn gender(&self) -> String {
        self.avatar.subject.gender.to_string()
    }

    /// How many coefficients of expression it takes.
    #[getter]
    fn expression_coefficients(&self) -> usize {
        self.avatar.subject.expressions
    }

    /// Steps on frames that it was trained for.
    #[getter]
    fn steps(&self) -> u64 {
        self.avatar.steps
    }

    /// The configuration that it was trained with, as TOML.
    #[getter]
    fn config(&self) -> PyResult<String> {
        self.avatar.config.to_toml().or_raise()
    }

    fn __repr__(&self) -> String {
        format!("<xavatar.Avatar on {}, {} steps>", self.skeleton().description(), self.avatar.steps)
    }
}

impl Avatar {
    fn own_pose<'py>(&self, py: Python<'py>, pose: Pose) -> PyResult<Bound<'py, PyAny>> {
        let expression = vec![0.0; self.avatar.subject.expressions];
        python_pose(py, &Pose { shape: self.avatar.subject.betas.clone(), expression, ..pose })
    }
}

/// A body model that a caller gives: the object, or where it is.
#[derive(FromPyObject)]
pub enum BodyArgument {
    /// One that is loaded.
    Loaded(Py<Body>),
    /// A file or a folder.
    Path(PathBuf),
}

impl BodyArgument {
    /// The body; a folder's is that of the gender.
    pub fn read(self, gender: xavatar::body::Gender) -> xavatar::Result<Body> {
        match self {
            Self::Loaded(body) => Ok(body.get().clone()),
            Self::Path(path) => Body::read(&path, gender),
        }
    }
}

fn given_points(given: &Bound<'_, PyAny>) -> PyResult<Vec<glam::Vec3>> {
    points("points", given)
}

fn python_samples(py: Python<'_>, samples: Vec<Sample>, joints: usize) -> PyResult<Bound<'_, PyAny>> {
    let count = samples.len();
    let (mut values, mut normals, mut colours, mut weights) = (
        Vec::with_capacity(count),
        Vec::with_capacity(count),
        Vec::with_capacity(count),
        Vec::with_capacity(count * joints),
    );
    for sample in samples {
        values.push(sample.value);
        normals.push(sample.normal);
        colours.push(sample.colour);
        weights.extend(sample.weights);
    }
    let weights = weights.into_pyarray(py).reshape([count, joints])?;
    let (normals, colours) = (array_of_points(py, normals)?, array_of_rows(py, colours)?);
    python_classes::samples(py)?.call1((values.into_pyarray(py), normals, colours, weights))
}
