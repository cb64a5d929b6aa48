//! Paper A's separated series.

use crate::body::Body;
use crate::body_methods::Watch;
use crate::convert;
use crate::settings::choose;
use crate::threads;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::BTreeMap;
use viscera_core::pgd::{Enrichment, Loads, Order, Pgd, PlainNewton, Route, Separated};

/// `F` (k, n, 3) and `G` (k, m).
type Modes<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>);

/// The series of a unit of load at each of the positions; `enrichment` None solves every position.
#[pyfunction]
#[pyo3(signature = (body, *, positions, radius, load, order, enrichment, on_progress))]
#[allow(clippy::too_many_arguments)]
pub fn pgd<'py>(
    py: Python<'py>,
    body: &Body,
    positions: PyReadonlyArray1<u32>,
    radius: f64,
    load: f64,
    order: usize,
    enrichment: Option<BTreeMap<String, f64>>,
    on_progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let nodes = positions.as_array().to_vec();
    let loads = Loads::new(&body.surface, &nodes, &body.fixed, radius).map_err(convert::error)?;
    let route = match enrichment {
        Some(settings) => {
            let mut enrichment = Enrichment::default();
            choose(&Enrichment::SETTINGS, &mut enrichment, "enrichment", &settings)?;
            Route::Greedy(enrichment)
        }
        None => Route::Direct,
    };
    let pgd = Pgd { order, load, route };
    let mut watch = Watch::new(on_progress);
    let result = threads::detached(py, || {
        pgd.run(&body.body, &body.fixed, &loads, &mut |p| watch.report((p.order, p.terms)))
    })?;
    let sizes = [body.body.n_dofs(), loads.len()];
    let orders = watch.outcome(result)?.into_iter().map(|order| order_dict(py, order, sizes));
    let dict = PyDict::new(py);
    dict.set_item("positions", PyArray1::from_slice(py, &loads.positions))?;
    dict.set_item("weights", PyArray1::from_slice(py, &loads.weights))?;
    let units = loads.unit.iter().map(|unit| {
        let (dofs, forces): (Vec<u32>, Vec<f64>) = unit.iter().copied().unzip();
        (PyArray1::from_vec(py, dofs), PyArray1::from_vec(py, forces))
    });
    dict.set_item("units", PyList::new(py, units.collect::<Vec<_>>())?)?;
    dict.set_item("orders", PyList::new(py, orders.collect::<PyResult<Vec<_>>>()?)?)?;
    Ok(dict)
}

/// Modes F (k, n, 3) and G (k, m) in as few pairs as `tolerance` allows.
#[pyfunction]
pub fn compress<'py>(
    py: Python<'py>,
    space: PyReadonlyArray2<f64>,
    position: PyReadonlyArray2<f64>,
    weights: PyReadonlyArray1<f64>,
    tolerance: f64,
) -> PyResult<Modes<'py>> {
    let rows = |array: &PyReadonlyArray2<f64>| -> Vec<Vec<f64>> {
        array.as_array().rows().into_iter().map(|row| row.to_vec()).collect()
    };
    let field = Separated { space: rows(&space), position: rows(&position) };
    let (n, m) = (space.as_array().ncols(), position.as_array().ncols());
    let weights = weights.as_array().to_vec();
    let small =
        threads::detached(py, || field.compress(&weights, tolerance))?.map_err(convert::error)?;
    modes(py, small, n, m)
}

/// Newton with full steps and equal increments: displacement (n, 3), increments that converged, iterations.
#[pyfunction]
#[pyo3(signature = (body, *, force, increments, max_iterations, tolerance))]
pub fn plain_newton<'py>(
    py: Python<'py>,
    body: &Body,
    force: PyReadonlyArray2<f64>,
    increments: usize,
    max_iterations: usize,
    tolerance: f64,
) -> PyResult<(Bound<'py, PyArray2<f64>>, usize, usize)> {
    let force = convert::dofs("force", &force, body.body.points().len())?;
    let newton = PlainNewton { increments, max_iterations, tolerance };
    let mut watch = Watch::new(None);
    let result = threads::detached(py, || {
        newton.solve(&body.body, &body.fixed, &force, &mut || watch.report(()))
    })?;
    let reached = watch.outcome(result)?;
    Ok((convert::field(py, reached.displacement)?, reached.increments, reached.iterations))
}

/// An order over `n` degrees of freedom and `m` positions; it may have no pairs.
fn order_dict(py: Python<'_>, order: Order, [n, m]: [usize; 2]) -> PyResult<Bound<'_, PyDict>> {
    let (space, position) = modes(py, order.field, n, m)?;
    let dict = PyDict::new(py);
    dict.set_item("F", space)?;
    dict.set_item("G", position)?;
    dict.set_item("sizes", PyArray1::from_vec(py, order.sizes))?;
    let iterations: Vec<u32> = order.iterations.iter().map(|&i| i as u32).collect();
    dict.set_item("iterations", PyArray1::from_vec(py, iterations))?;
    dict.set_item("is_cut", order.is_cut)?;
    dict.set_item("seconds_rhs", order.seconds_rhs)?;
    dict.set_item("seconds_solve", order.seconds_solve)?;
    Ok(dict)
}

fn modes(py: Python<'_>, field: Separated, n: usize, m: usize) -> PyResult<Modes<'_>> {
    let k = field.len();
    let space = PyArray1::from_vec(py, field.space.concat()).reshape([k, n / 3, 3])?;
    let position = PyArray1::from_vec(py, field.position.concat()).reshape([k, m])?;
    Ok((space, position))
}
