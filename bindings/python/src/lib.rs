//! The private module `viscera._core`: translation between NumPy arrays and `viscera-core` (and `viscera-mesher`).
//!
//! `python/viscera/_core.pyi` documents what is exported. No numerics here: every function
//! converts its arguments, makes one call with the interpreter released, and converts the result.

mod body;
mod body_methods;
mod compliance;
mod contact;
mod convert;
mod exclusive;
mod factor;
mod family;
mod galerkin;
mod gpu;
mod interrupt;
mod law;
mod live;
mod mesh;
mod mesher;
mod model;
mod path;
mod pgd;
mod probe;
mod settings;
mod stepper;
mod threads;
mod touch;

use pyo3::prelude::*;

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_function(wrap_pyfunction!(mesh::surface, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::inspect, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::overlap, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::quadratic, m)?)?;
    m.add_function(wrap_pyfunction!(mesh::quadratic_surface, m)?)?;
    m.add_function(wrap_pyfunction!(mesher::mesh_labels, m)?)?;
    m.add_function(wrap_pyfunction!(mesher::winding_numbers, m)?)?;
    m.add_function(wrap_pyfunction!(path::vector_pade, m)?)?;
    m.add_function(wrap_pyfunction!(touch::touch_series, m)?)?;
    m.add_function(wrap_pyfunction!(pgd::pgd, m)?)?;
    m.add_function(wrap_pyfunction!(pgd::compress, m)?)?;
    m.add_function(wrap_pyfunction!(pgd::plain_newton, m)?)?;
    m.add_function(wrap_pyfunction!(settings::elements, m)?)?;
    m.add_function(wrap_pyfunction!(settings::preconditioners, m)?)?;
    m.add_function(wrap_pyfunction!(settings::solver_settings, m)?)?;
    m.add_function(wrap_pyfunction!(gpu::load_gpu, m)?)?;
    m.add_function(wrap_pyfunction!(gpu::gpu, m)?)?;
    m.add_function(wrap_pyfunction!(gpu::gpu_traffic, m)?)?;
    m.add_function(wrap_pyfunction!(gpu::lose_gpu, m)?)?;
    m.add_class::<factor::Factor>()?;
    m.add_function(wrap_pyfunction!(law::laws, m)?)?;
    m.add_function(wrap_pyfunction!(law::law_parameters, m)?)?;
    m.add_class::<law::Law>()?;
    m.add_class::<mesh::Surface>()?;
    m.add_class::<mesh::Locator>()?;
    m.add_class::<mesh::Patch>()?;
    m.add_class::<contact::Shape>()?;
    m.add_class::<body::Body>()?;
    m.add_class::<compliance::Compliance>()?;
    m.add_class::<stepper::Stepper>()?;
    m.add("VOLUME_BOUNDS", viscera_core::equilibrium::VOLUME_BOUNDS)?;
    m.add_class::<live::Live>()?;
    m.add_class::<model::Model>()?;
    m.add_class::<probe::Probe>()?;
    m.add_class::<probe::Probes>()?;
    m.add("CONTACT_ERROR", viscera_core::reduced::CONTACT_ERROR)?;
    m.add("PROBE_TOLERANCE", viscera_core::reduced::TOLERANCE)?;
    m.add_class::<galerkin::Galerkin>()?;
    m.add_class::<galerkin::HyperReducedModel>()?;
    m.add_class::<galerkin::GalerkinAnswer>()?;
    Ok(())
}
