//! The classes of the package that are written in Python: plain data, and the exceptions.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

macro_rules! class {
    ($function:ident, $module:literal, $name:literal) => {
        #[doc = concat!("`", $module, ".", $name, "`.")]
        pub fn $function(py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
            static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
            CLASS.import(py, $module, $name)
        }
    };
}

class!(mesh, "xavatar.mesh", "Mesh");
class!(pose, "xavatar.pose", "Pose");
class!(samples, "xavatar.samples", "Samples");
class!(motion, "xavatar.motion", "Motion");
class!(frame, "xavatar.frame", "Frame");
class!(event, "xavatar.event", "Event");
