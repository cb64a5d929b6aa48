//! All laws, a row for each: everything that case files, model files, Python, samples and tests need of a law, and how
//! it is made. A new law is a file beside this one and a row here.

use super::kernels::{LawKernels, Rows};
use super::linear::LINEAR;
use super::{
    ArrudaBoyce, Corotated, Fung, HolzapfelGasserOgden, Linear, MooneyRivlin, NeoHookean, Ogden,
    SaintVenantKirchhoff, StableNeoHookean, VerondaWestmann, Volumetric, Yeoh,
};
use std::sync::Arc;

/// A quantity that must be positive: its name in errors, and its value for a row of parameters.
pub type Condition = (&'static str, fn(&[f64]) -> f64);

/// Description of a law.
pub struct Row {
    /// Its name in model files.
    pub name: &'static str,
    /// The columns of a row of parameters.
    pub parameters: &'static [Parameter],
    /// Further quantities that must be positive.
    pub conditions: &'static [Condition],
    /// Whether the energy has a power series at rest.
    pub is_analytic: bool,
    /// A soft tissue for tests and examples: a shear modulus of about 3 kPa, and as incompressible as difference
    /// quotients of energies allow.
    pub sample: &'static [f64],
    /// Makes its kernels.
    pub kernels: fn() -> Arc<dyn LawKernels>,
}

impl Row {
    /// The columns that are stresses [Pa], to which together the energy is proportional.
    pub fn stresses(&self) -> Vec<usize> {
        let is_stress = |&k: &usize| self.parameters[k].kind == Kind::Stress;
        (0..self.parameters.len()).filter(is_stress).collect()
    }
}

/// A parameter of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// Its meaning.
    pub means: &'static str,
    /// What it is.
    pub kind: Kind,
    /// Which values it may have.
    pub bounds: Bounds,
    /// Its default.
    pub default: Option<f64>,
}

/// What a parameter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A stress [Pa]; the energy is proportional to all of them together.
    Stress,
    /// A number.
    Number,
    /// A component of a unit direction of fibres at rest.
    Fibre,
}

impl Kind {
    /// Its unit.
    pub fn unit(self) -> &'static str {
        if self == Kind::Stress { "Pa" } else { "1" }
    }
}

/// Which values a parameter may have; none but finite ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bounds {
    /// Any.
    Any,
    /// Above zero.
    Positive,
    /// Any but zero.
    NotZero,
    /// Between two values, both allowed.
    Within(f64, f64),
}

impl Bounds {
    /// Whether a value is allowed.
    pub fn allow(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Bounds::Any => true,
                Bounds::Positive => value > 0.0,
                Bounds::NotZero => value != 0.0,
                Bounds::Within(low, high) => (low..=high).contains(&value),
            }
    }

    /// What they ask for, in words.
    pub fn words(self) -> String {
        match self {
            Bounds::Any => "must be finite".into(),
            Bounds::Positive => "must be finite and positive".into(),
            Bounds::NotZero => "must be finite and not zero".into(),
            Bounds::Within(low, high) => format!("must lie between {low} and {high:.4}"),
        }
    }
}

/// A stress above zero.
const fn modulus(name: &'static str, means: &'static str) -> Parameter {
    Parameter { name, means, kind: Kind::Stress, bounds: Bounds::Positive, default: None }
}

/// A stress of any sign.
const fn stress(name: &'static str, means: &'static str) -> Parameter {
    Parameter { bounds: Bounds::Any, ..modulus(name, means) }
}

/// A number.
const fn number(name: &'static str, means: &'static str, bounds: Bounds) -> Parameter {
    Parameter { name, means, kind: Kind::Number, bounds, default: None }
}

const fn or(default: f64, parameter: Parameter) -> Parameter {
    Parameter { default: Some(default), ..parameter }
}

/// A component of a direction.
const fn fibre(name: &'static str) -> Parameter {
    let means = "component of a direction of fibres";
    Parameter { name, means, kind: Kind::Fibre, bounds: Bounds::Any, default: None }
}

/// Shear modulus and first Lamé constant.
const LAME: &[Parameter] = &[modulus("mu", "shear modulus"), stress("lam", "first Lamé constant")];
const LAME_CONDITIONS: &[Condition] =
    &[("lam + 2 mu / 3, the bulk modulus,", |p| p[1] + 2.0 / 3.0 * p[0])];
const LAME_SAMPLE: &[f64] = &[3.0e3, 11.0e3];

const MOONEY_RIVLIN: Row = Row {
    name: "mooney_rivlin J-1",
    parameters: &[
        stress("c1", "coefficient of I1' - 3"),
        stress("c2", "coefficient of I2' - 3"),
        modulus("kappa", "bulk modulus at small strain"),
    ],
    conditions: &[("c1 + c2, half the shear modulus,", |p| p[0] + p[1])],
    is_analytic: true,
    sample: &[1.2e3, 0.3e3, 11.0e3],
    kernels: || {
        Arc::new(Rows(|p| MooneyRivlin {
            c1: p[0],
            c2: p[1],
            kappa: p[2],
            volumetric: Volumetric::Jacobian,
        }))
    },
};

const HOLZAPFEL_GASSER_OGDEN: Row = Row {
    name: "holzapfel_gasser_ogden",
    parameters: &[
        modulus("c", "shear modulus of the ground substance"),
        modulus("k1", "stiffness of the fibres"),
        number("k2", "coefficient in the exponent of the fibres", Bounds::Positive),
        or(
            0.0,
            number(
                "dispersion",
                "of the fibres: 0 where they are parallel, 1/3 where they point everywhere",
                Bounds::Within(0.0, 1.0 / 3.0),
            ),
        ),
        modulus("kappa", "bulk modulus at small strain"),
        fibre("a0x"),
        fibre("a0y"),
        fibre("a0z"),
        fibre("a1x"),
        fibre("a1y"),
        fibre("a1z"),
    ],
    conditions: &[],
    // Fibres that bear no compression begin to bear at rest.
    is_analytic: false,
    // The fibres cross about the first axis.
    sample: &[3.0e3, 0.5e3, 0.8, 0.1, 13.0e3, 0.8, 0.6, 0.0, 0.8, -0.6, 0.0],
    kernels: || Arc::new(Rows(|p| holzapfel_gasser_ogden(p, false))),
};

fn holzapfel_gasser_ogden(p: &[f64], bear_compression: bool) -> HolzapfelGasserOgden {
    let fibres = [[p[5], p[6], p[7]], [p[8], p[9], p[10]]];
    let [c, k1, k2, dispersion, kappa] = [p[0], p[1], p[2], p[3], p[4]];
    HolzapfelGasserOgden { c, k1, k2, dispersion, kappa, fibres, bear_compression }
}

/// All laws. A static, not a constant: every reader of a constant would compile the kernels of all laws again.
pub static ROWS: &[Row] = &[
    Row {
        name: LINEAR,
        parameters: LAME,
        conditions: LAME_CONDITIONS,
        is_analytic: true,
        sample: LAME_SAMPLE,
        kernels: || Arc::new(Rows(|p| Linear { mu: p[0], lam: p[1] })),
    },
    Row {
        name: "corotated",
        parameters: LAME,
        conditions: LAME_CONDITIONS,
        is_analytic: true,
        sample: LAME_SAMPLE,
        kernels: || Arc::new(Rows(|p| Corotated { mu: p[0], lam: p[1] })),
    },
    Row {
        name: "saint_venant_kirchhoff",
        parameters: LAME,
        conditions: LAME_CONDITIONS,
        is_analytic: true,
        sample: LAME_SAMPLE,
        kernels: || Arc::new(Rows(|p| SaintVenantKirchhoff { mu: p[0], lam: p[1] })),
    },
    Row {
        name: "neo_hookean",
        parameters: LAME,
        conditions: LAME_CONDITIONS,
        is_analytic: true,
        sample: LAME_SAMPLE,
        kernels: || Arc::new(Rows(|p| NeoHookean { mu: p[0], lam: p[1] })),
    },
    MOONEY_RIVLIN,
    Row {
        name: "mooney_rivlin J^2-1",
        kernels: || {
            Arc::new(Rows(|p| MooneyRivlin {
                c1: p[0],
                c2: p[1],
                kappa: p[2],
                volumetric: Volumetric::JacobianSquared,
            }))
        },
        ..MOONEY_RIVLIN
    },
    Row {
        name: "mooney_rivlin ln J",
        kernels: || {
            Arc::new(Rows(|p| MooneyRivlin {
                c1: p[0],
                c2: p[1],
                kappa: p[2],
                volumetric: Volumetric::Logarithm,
            }))
        },
        ..MOONEY_RIVLIN
    },
    Row {
        name: "yeoh",
        parameters: &[
            modulus("c10", "half the shear modulus"),
            or(0.0, stress("c20", "coefficient of (I1' - 3)^2")),
            or(0.0, stress("c30", "coefficient of (I1' - 3)^3")),
            modulus("kappa", "bulk modulus at small strain"),
        ],
        conditions: &[],
        is_analytic: true,
        sample: &[1.5e3, 0.3e3, 0.1e3, 13.0e3],
        kernels: || Arc::new(Rows(|p| Yeoh { c: [p[0], p[1], p[2]], kappa: p[3] })),
    },
    Row {
        name: "ogden",
        parameters: &[
            stress("mu1", "modulus of a term"),
            or(0.0, stress("mu2", "modulus of a term")),
            or(0.0, stress("mu3", "modulus of a term")),
            number("alpha1", "exponent of a term", Bounds::NotZero),
            or(1.0, number("alpha2", "exponent of a term", Bounds::NotZero)),
            or(1.0, number("alpha3", "exponent of a term", Bounds::NotZero)),
            modulus("kappa", "bulk modulus at small strain"),
        ],
        conditions: &[("the shear modulus, half the sum of mu alpha,", |p| {
            0.5 * (p[0] * p[3] + p[1] * p[4] + p[2] * p[5])
        })],
        is_analytic: true,
        sample: &[1.0e3, -0.1e3, 2.0e3, 1.3, -5.0, 2.1, 13.0e3],
        kernels: || {
            Arc::new(Rows(|p| Ogden {
                mu: [p[0], p[1], p[2]],
                alpha: [p[3], p[4], p[5]],
                kappa: p[6],
            }))
        },
    },
    Row {
        name: "stable_neo_hookean",
        parameters: LAME,
        conditions: LAME_CONDITIONS,
        is_analytic: true,
        sample: LAME_SAMPLE,
        kernels: || Arc::new(Rows(|p| StableNeoHookean { mu: p[0], lam: p[1] })),
    },
    Row {
        name: "arruda_boyce",
        parameters: &[
            modulus("mu", "shear modulus"),
            number("lambda_m", "stretch at which the chains lock", Bounds::Positive),
            modulus("kappa", "bulk modulus at small strain"),
        ],
        conditions: &[],
        is_analytic: true,
        sample: &[3.0e3, 1.4, 13.0e3],
        kernels: || Arc::new(Rows(|p| ArrudaBoyce { mu: p[0], lambda_m: p[1], kappa: p[2] })),
    },
    Row {
        name: "veronda_westmann",
        parameters: &[
            modulus("c1", "stiffness; the shear modulus is c1 c2"),
            number("c2", "coefficient in the exponent", Bounds::Positive),
            modulus("kappa", "bulk modulus at small strain"),
        ],
        conditions: &[],
        is_analytic: true,
        sample: &[4.0e3, 0.75, 13.0e3],
        kernels: || Arc::new(Rows(|p| VerondaWestmann { c1: p[0], c2: p[1], kappa: p[2] })),
    },
    Row {
        name: "fung",
        parameters: &[
            modulus("mu", "shear modulus"),
            number("b", "coefficient in the exponent", Bounds::Positive),
            modulus("kappa", "bulk modulus at small strain"),
        ],
        conditions: &[],
        is_analytic: true,
        sample: &[3.0e3, 1.2, 13.0e3],
        kernels: || Arc::new(Rows(|p| Fung { mu: p[0], b: p[1], kappa: p[2] })),
    },
    HOLZAPFEL_GASSER_OGDEN,
    Row {
        name: "holzapfel_gasser_ogden both ways",
        is_analytic: true,
        kernels: || Arc::new(Rows(|p| holzapfel_gasser_ogden(p, true))),
        ..HOLZAPFEL_GASSER_OGDEN
    },
];
