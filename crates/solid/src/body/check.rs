//! Checks of a body's input: meshes without usable cells, parameters and densities that do not fit
//! the mesh.

use crate::element::Geometry;
use crate::error::Error;
use crate::law::Material;

/// The geometry of every cell, or why the mesh has none.
pub(super) fn mesh(points: &[[f64; 3]], cells: &[[u32; 4]]) -> Result<Vec<Geometry>, Error> {
    if cells.is_empty() {
        return Err(Error::input("the mesh has no tetrahedra; give at least one cell"));
    }
    if let Some((n, x)) = points.iter().enumerate().find(|(_, x)| x.iter().any(|c| !c.is_finite()))
    {
        return Err(Error::input(format!("point {n} is at {x:?}; coordinates must be finite")));
    }
    let mut elements = Vec::with_capacity(cells.len());
    for (cell, nodes) in cells.iter().enumerate() {
        if let Some(node) = nodes.iter().find(|&&node| node as usize >= points.len()) {
            return Err(Error::input(format!(
                "cell {cell} uses point {node}; there are {} points",
                points.len()
            )));
        }
        let element = Geometry::new(nodes.map(|n| points[n as usize]));
        if !(element.volume > 0.0) || element.gradients.iter().flatten().any(|g| !g.is_finite()) {
            return Err(Error::input(format!(
                "cell {cell} has volume {:.3e} m^3; repair the mesh so that every volume is positive",
                element.volume
            )));
        }
        elements.push(element);
    }
    let mut is_used = vec![false; points.len()];
    cells.iter().flatten().for_each(|&node| is_used[node as usize] = true);
    if let Some(loose) = is_used.iter().position(|used| !used) {
        return Err(Error::input(format!(
            "point {loose} belongs to no cell; remove loose points from the mesh"
        )));
    }
    Ok(elements)
}

pub(super) fn parameter_rows(material: &Material, n_cells: usize) -> Result<(), Error> {
    let rows = material.parameters().len();
    if rows == 1 || rows == n_cells {
        return Ok(());
    }
    Err(Error::input(format!(
        "law {}: {rows} parameter rows for {n_cells} cells; give one row, or one per cell",
        material.name()
    )))
}

pub(super) fn densities(density: &[f64], n_cells: usize) -> Result<(), Error> {
    if density.len() != 1 && density.len() != n_cells {
        return Err(Error::input(format!(
            "{} densities for {n_cells} cells; give one, or one per cell",
            density.len()
        )));
    }
    if let Some(&bad) = density.iter().find(|d| !d.is_finite() || **d < 0.0) {
        return Err(Error::input(format!("density {bad} kg/m^3; it must be finite and >= 0")));
    }
    Ok(())
}
