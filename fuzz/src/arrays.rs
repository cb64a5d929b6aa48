//! The arrays of a model by number, and edits of them.

use crate::Script;
use viscera_touch::Arrays;

/// One array of a model.
pub(crate) enum Field<'a> {
    Double(&'a mut Vec<f64>),
    Single(&'a mut Vec<f32>),
    Index(&'a mut Vec<u32>),
    Mode(&'a mut Vec<i16>),
}

impl<'a> Field<'a> {
    pub(crate) fn of(a: &'a mut Arrays, which: u8) -> Self {
        match which % 43 {
            0 => Field::Double(&mut a.points),
            1 => Field::Index(&mut a.cells),
            2 => Field::Index(&mut a.fixed),
            3 => Field::Double(&mut a.law_parameters),
            4 => Field::Index(&mut a.surface),
            5 => Field::Index(&mut a.surface_nodes),
            6 => Field::Index(&mut a.positions),
            7 => Field::Index(&mut a.touchable),
            8 => Field::Index(&mut a.edges),
            9 => Field::Index(&mut a.triangle_edges),
            10 => Field::Index(&mut a.patch_start),
            11 => Field::Index(&mut a.patch_nodes),
            12 => Field::Double(&mut a.patch_weights),
            13 => Field::Double(&mut a.answers.compliance),
            14 => Field::Double(&mut a.answers.cross_compliance),
            15 => Field::Double(&mut a.answers.force),
            16 => Field::Double(&mut a.answers.edge_force),
            17 => Field::Single(&mut a.answers.norms),
            18 => Field::Single(&mut a.answers.compression),
            19 => Field::Index(&mut a.position_region),
            20 => Field::Index(&mut a.edge_region),
            21 => Field::Index(&mut a.region_start),
            22 => Field::Single(&mut a.mode_scale),
            23 => Field::Mode(&mut a.surface_modes),
            24 => Field::Mode(&mut a.interior_modes),
            25 => Field::Single(&mut a.answers.position_coefficients),
            26 => Field::Single(&mut a.answers.edge_coefficients),
            27 => Field::Double(&mut a.preload),
            28 => Field::Index(&mut a.parameter_cells),
            29 => Field::Double(&mut a.family.compliance),
            30 => Field::Double(&mut a.family.cross_compliance),
            31 => Field::Double(&mut a.family.force),
            32 => Field::Double(&mut a.family.edge_force),
            33 => Field::Single(&mut a.family.norms),
            34 => Field::Single(&mut a.family.compression),
            35 => Field::Single(&mut a.family.position_coefficients),
            36 => Field::Single(&mut a.family.edge_coefficients),
            37 => Field::Single(&mut a.answers.sketch),
            38 => Field::Single(&mut a.family.sketch),
            39 => Field::Single(&mut a.answers.linear_compression),
            40 => Field::Single(&mut a.family.linear_compression),
            41 => Field::Single(&mut a.answers.departure),
            _ => Field::Single(&mut a.family.departure),
        }
    }

    pub(crate) fn edit(self, script: &mut Script) {
        match self {
            Field::Double(values) => edit(values, script, |s| s.number()),
            Field::Single(values) => edit(values, script, |s| f32::from_le_bytes(s.bytes())),
            Field::Mode(values) => edit(values, script, |s| i16::from_le_bytes(s.bytes())),
            // Small numbers are often valid indices.
            Field::Index(values) => edit(values, script, |s| match s.byte() {
                small @ 0..=191 => u32::from(small),
                _ => u32::from_le_bytes(s.bytes()),
            }),
        }
    }
}

fn edit<T: Copy + Default>(values: &mut Vec<T>, script: &mut Script, value: fn(&mut Script) -> T) {
    let (what, place) = (script.byte(), script.index());
    match (what % 6, values.len()) {
        (0..=2, n) if n > 0 => values[place % n] = value(script),
        (3, _) => values.truncate(place),
        (4, _) => values.push(value(script)),
        (5, n) if n > 0 => values.swap(place % n, script.index() % n),
        _ => values.fill(T::default()),
    }
}
