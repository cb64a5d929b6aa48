//! The off-line stage: all positions and orders solved exactly with one factorisation, compressed
//! region by region, checked between positions, and put together as a model; for a range of a
//! parameter, the same at several values with modes in common.

use super::assemble::assemble;
use super::batch::{Batches, Nowhere};
use super::measure::Measured;
use super::positions::Positions;
use super::preload;
use super::refused::unusable;
use super::settings::{Family, Member, Progress, Reduction};
use super::solve::{EDGE_ORDER, Expanded};
use crate::body::Body;
use crate::clock::Instant;
use crate::error::Error;
use crate::mesh::{Surface, diagonal};
use viscera_touch::{Arrays, Errors, Metadata, ReducedModel, UNITS};

impl Reduction {
    /// Builds the model; `progress` is called from this thread and may return false to stop.
    ///
    /// # Errors
    /// Bad settings; a preload that is no stable equilibrium; a stop on request.
    pub fn run(
        &self,
        body: &Body,
        surface: &Surface,
        fixed: &[u32],
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<ReducedModel, Error> {
        self.run_kept(body, None, surface, fixed, (&mut Nowhere, progress))
    }

    /// Builds one model for a range of a parameter, set to the value of `body`.
    ///
    /// # Errors
    /// Those of [`Reduction::run`]; a preload, which would be another for every value.
    pub fn run_family(
        &self,
        body: &Body,
        family: &Family,
        surface: &Surface,
        fixed: &[u32],
        progress: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<ReducedModel, Error> {
        self.run_kept(body, Some(family), surface, fixed, (&mut Nowhere, progress))
    }

    /// [`Reduction::run`] or, for a range of a parameter, [`Reduction::run_family`], that keeps finished batches of
    /// positions and goes on from those kept before.
    ///
    /// # Errors
    /// Those of the two.
    pub fn run_kept(
        &self,
        body: &Body,
        family: Option<&Family>,
        surface: &Surface,
        fixed: &[u32],
        watch: (&mut dyn Batches, &mut dyn FnMut(Progress) -> bool),
    ) -> Result<ReducedModel, Error> {
        if let Some(family) = family
            && !self.preload.is_empty()
        {
            return Err(Error::input(format!(
                "the loaded shape is another for every {}; reduce for a range of it from rest, or at one value from \
                 the load",
                family.parameter.name
            )));
        }
        self.build(Member { body, radius: self.radius }, family, surface, fixed, watch)
    }

    fn build<'a>(
        &self,
        own: Member<'a>,
        family: Option<&Family<'a>>,
        surface: &Surface,
        fixed: &[u32],
        (batches, progress): (&mut dyn Batches, &mut dyn FnMut(Progress) -> bool),
    ) -> Result<ReducedModel, Error> {
        let (clock, body) = (Instant::now(), own.body);
        preload::check(body, fixed, &self.preload)?;
        let surface = &preload::shape(surface, &self.preload);
        let diagonal = diagonal(surface.points());
        if fixed.is_empty() && body.ties().is_none() {
            return Err(Error::input("nothing is fixed; an organ that floats cannot be pushed"));
        }
        if !body.contact_pairs().is_empty() {
            return Err(Error::input(
                "a series does not know surfaces that touch; leave the contact pairs out, or solve",
            ));
        }
        if body.has_links() {
            return Err(Error::input(
                "a series does not know springs and cables; leave them out, or solve",
            ));
        }
        self.check(diagonal)?;
        let expand = |member: &Member<'a>| {
            let positions = Positions::new(surface, &self.touchable, fixed, member.radius)?;
            let order = self.next_order();
            let expansion = preload::expansion(member.body, fixed, &self.preload, order)?;
            let expansion = match &self.device {
                Some(device) => expansion.on_device(device),
                None => expansion,
            };
            Ok(Expanded { positions, expansion })
        };
        let members: Vec<Expanded> = match family {
            Some(family) => family.members.iter().map(expand).collect::<Result<_, Error>>()?,
            None => vec![expand(&own)?],
        };
        let solved = self.solve_regions(&members, batches, progress)?;
        let compression = solved
            .iter()
            .flat_map(|s| s.region.members.iter().flat_map(|m| &m.errors))
            .fold(0.0, |worst, &e| f64::max(worst, f64::from(e)));
        let metadata = Metadata {
            format_version: Metadata::version_for(self.norm_length()),
            package_version: env!("CARGO_PKG_VERSION").to_string(),
            units: UNITS.to_string(),
            law: body.material().name().to_string(),
            law_parameter_names: body.material().names().to_vec(),
            element: body.element().name().to_string(),
            radius: self.radius,
            depth: self.depth,
            order: self.order,
            edge_order: EDGE_ORDER.min(self.order),
            tolerance: self.tolerance,
            diagonal,
            errors: Errors { compression, ..Errors::default() },
            interpolation_shares: None,
            truncation_share: None,
            is_pole_aware: self.is_sketched(),
            norm_length: self.norm_length(),
            seconds: 0.0,
            parameter: family.map(|f| f.parameter.clone()),
            user: self.user.clone(),
        };
        let arrays = Arrays {
            preload: self.preload.clone(),
            parameter_cells: family.map_or(Vec::new(), |f| f.cells.clone()),
            ..assemble(body, surface, fixed, &members, solved)
        };
        let mut model = ReducedModel::new(metadata, arrays).map_err(unusable)?;
        let mut measured = Measured::new(model.metadata().errors);
        self.measure_interpolation(&members, &mut model, &mut measured, progress)?;
        if let Some(family) = family {
            for (value, member) in &family.unseen {
                self.measure_parameter(
                    &expand(member)?,
                    *value,
                    &mut model,
                    &mut measured.errors,
                    progress,
                )?;
            }
        }
        let (metadata, arrays) = model.into_parts();
        let Measured { errors, interpolation_shares, truncation_share } = measured;
        let metadata = Metadata { errors, interpolation_shares, truncation_share, ..metadata };
        let model = ReducedModel::new(metadata, arrays).map_err(unusable)?;
        let (mut model, asked) = self.with_unseen_rest(&members, fixed, model, progress)?;
        let departures = self.measure_departure(&members, fixed, (&mut model, asked), progress)?;
        let (metadata, mut arrays) = model.into_parts();
        if family.is_some() {
            arrays.family.departure = departures.concat();
        }
        arrays.answers.departure = departures.into_iter().next().unwrap_or_default();
        let metadata = Metadata { seconds: clock.elapsed().as_secs_f64(), ..metadata };
        let mut model = ReducedModel::new(metadata, arrays).map_err(unusable)?;
        if let Some(family) = family {
            model.set_parameter(family.parameter.value).map_err(unusable)?;
        }
        Ok(model)
    }

    fn check(&self, diagonal: f64) -> Result<(), Error> {
        if !(2..=8).contains(&self.order) {
            return Err(Error::input(format!("order {}; it must be between 2 and 8", self.order)));
        }
        for (name, value, limit) in [
            ("radius", self.radius, diagonal),
            ("depth", self.depth, diagonal),
            ("tolerance", self.tolerance, 1.0),
        ] {
            if !(value > 0.0 && value < limit) {
                return Err(Error::input(format!(
                    "{name} = {value}; it must be above 0 and below {limit:.4}{}",
                    if name == "tolerance" { "" } else { " m, the diagonal of the organ" }
                )));
            }
        }
        Ok(())
    }
}
