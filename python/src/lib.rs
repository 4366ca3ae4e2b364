//! The library for Python: what the package `xavatar` (python/xavatar) calls, over numpy's arrays.
//!
//! Nothing is computed here that the library does not compute. Arrays that come back take over the library's memory; calls that take
//! time let go of the interpreter's lock; what goes wrong is raised with the remedy in Python's words (`errors`).

#![deny(clippy::disallowed_methods)]

mod arrays;
mod avatar;
mod body;
mod errors;
mod evaluation;
mod meshes;
mod motion;
mod posed_bodies;
mod poses;
mod python_classes;
mod registration;
mod subject;
mod topology;
mod training;
mod watch;

use pyo3::prelude::*;

/// The classes and functions that `xavatar` shows under its own name.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<avatar::Avatar>()?;
    module.add_class::<topology::FixedTopology>()?;
    module.add_class::<body::Body>()?;
    module.add_class::<posed_bodies::PosedBodies>()?;
    module.add_class::<subject::Subject>()?;
    module.add_function(wrap_pyfunction!(meshes::read_mesh, module)?)?;
    module.add_function(wrap_pyfunction!(meshes::write_mesh, module)?)?;
    module.add_function(wrap_pyfunction!(motion::read_motion, module)?)?;
    module.add_function(wrap_pyfunction!(training::train, module)?)?;
    module.add_function(wrap_pyfunction!(evaluation::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(registration::register, module)?)?;
    module.add_function(wrap_pyfunction!(subject::write_built_in_subject, module)?)?;
    Ok(())
}
