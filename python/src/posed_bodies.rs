//! `xavatar.PosedBodies`: a batch of bodies, and the way back from gradients of what they are to gradients of their poses.

use std::sync::Arc;

use numpy::{Element, IntoPyArray, PyArrayDescrMethods, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods, dtype};
use pyo3::prelude::*;
use xavatar::body::{BodyModel, PoseBatch, PosedBatch};
use xavatar_vector::Scalar;

use crate::arrays::{Numbers, array_of_frames, array_of_rows};
use crate::errors::{Raise, refused};

/// A batch of posed bodies. B frames, V vertices, J joints, K coefficients.
#[pyclass(frozen, module = "xavatar")]
pub struct PosedBodies {
    /// The vertices (B, V, 3), metres.
    #[pyo3(get)]
    vertices: Py<PyAny>,
    /// The joints (B, J, 3), metres.
    #[pyo3(get)]
    joints: Py<PyAny>,
    model: Arc<BodyModel>,
    batch: Batch,
}

/// A batch in the precision that it was given in.
enum Batch {
    Single(Posed<f32>),
    Double(Posed<f64>),
}

/// What a batch was made of, and what its pullback needs.
struct Posed<T> {
    poses: PoseBatch<T>,
    bodies: PosedBatch<T>,
}

/// Rotations, coefficients and translations.
type Arguments<'a, 'py> = (&'a Bound<'py, PyAny>, Option<&'a Bound<'py, PyAny>>, Option<&'a Bound<'py, PyAny>>);

impl PosedBodies {
    /// The bodies of a batch of poses.
    pub fn of(
        model: Arc<BodyModel>,
        rotations: &Bound<'_, PyAny>,
        coefficients: Option<&Bound<'_, PyAny>>,
        translations: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = rotations.py();
        let array = py.import("numpy")?.call_method1("asarray", (rotations,))?;
        let is_double = array.cast::<PyUntypedArray>()?.dtype().is_equiv_to(&dtype::<f64>(py));
        let arguments = (&array, coefficients, translations);
        let (vertices, joints, batch) = if is_double {
            let (vertices, joints, posed) = posed(&model, arguments)?;
            (vertices, joints, Batch::Double(posed))
        } else {
            let (vertices, joints, posed) = posed(&model, arguments)?;
            (vertices, joints, Batch::Single(posed))
        };
        Ok(Self { vertices, joints, model, batch })
    }
}

#[pymethods]
impl PosedBodies {
    /// The gradient of any function of these bodies, given its gradient in their vertices (B, V, 3) and joints (B, J, 3); what is left
    /// out is zero. Returns that in rotations (B, J, 3), coefficients (B, K) and translations (B, 3).
    #[pyo3(signature = (vertices = None, joints = None))]
    fn pullback<'py>(
        &self,
        py: Python<'py>,
        vertices: Option<&Bound<'py, PyAny>>,
        joints: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        match &self.batch {
            Batch::Single(posed) => posed.pullback(py, &self.model, vertices, joints),
            Batch::Double(posed) => posed.pullback(py, &self.model, vertices, joints),
        }
    }
}

fn posed<T: Scalar + Element>(
    model: &BodyModel,
    (rotations, coefficients, translations): Arguments<'_, '_>,
) -> PyResult<(Py<PyAny>, Py<PyAny>, Posed<T>)> {
    let py = rotations.py();
    let joints = model.skeleton().joints.len();
    let count = model.shape_coefficients() + model.expression_coefficients();
    let rotations = Numbers::<T>::of(rotations)?;
    let frames = rotations.frames("rotations", 3 * joints, &format!("(B, {joints}, 3)"))?;
    let of_frames = |name: &str, given: Option<&Bound<'_, PyAny>>, width: usize| {
        let Some(given) = given else { return Ok(vec![T::zero(); frames * width]) };
        let numbers = Numbers::<T>::of(given)?;
        let expected = format!("({frames}, {width})");
        match numbers.frames(name, width, &expected)? {
            found if found == frames => Ok(numbers.values()?.to_vec()),
            found => Err(refused(name, format!("of {found} frames"), expected)),
        }
    };
    let poses = PoseBatch {
        rotations: rotations.rows("rotations")?.to_vec(),
        coefficients: of_frames("coefficients", coefficients, count)?,
        translations: of_frames("translations", translations, 3)?.as_chunks().0.to_vec(),
    };
    let mut bodies = py.detach(|| model.pose_batch(&poses)).or_raise()?;
    let vertices = array_of_frames(py, std::mem::take(&mut bodies.vertices), frames)?;
    let places = array_of_frames(py, std::mem::take(&mut bodies.joints), frames)?;
    Ok((vertices.into_any().unbind(), places.into_any().unbind(), Posed { poses, bodies }))
}

impl<T: Scalar + Element> Posed<T> {
    fn pullback<'py>(
        &self,
        py: Python<'py>,
        model: &BodyModel,
        vertices: Option<&Bound<'py, PyAny>>,
        joints: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let frames = self.poses.frames();
        let (of_vertices, of_joints) =
            (vertices.map(Numbers::<T>::of).transpose()?, joints.map(Numbers::<T>::of).transpose()?);
        let (zero_vertices, zero_joints);
        let of_vertices = match &of_vertices {
            Some(given) => given.rows("the gradient of vertices")?,
            None => {
                zero_vertices = vec![[T::zero(); 3]; frames * model.vertex_count()];
                &zero_vertices
            }
        };
        let of_joints = match &of_joints {
            Some(given) => given.rows("the gradient of joints")?,
            None => {
                zero_joints = vec![[T::zero(); 3]; self.poses.rotations.len()];
                &zero_joints
            }
        };
        let pulled = py.detach(|| self.bodies.pullback(model, &self.poses, of_vertices, of_joints)).or_raise()?;
        let count = pulled.coefficients.len() / frames.max(1);
        Ok((
            array_of_frames(py, pulled.rotations, frames)?.into_any(),
            pulled.coefficients.into_pyarray(py).reshape([frames, count])?.into_any(),
            array_of_rows(py, pulled.translations)?.into_any(),
        ))
    }
}
