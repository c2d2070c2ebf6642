//! What a ping samples with dedicated rays: targets that scatter as a whole, and bodies that its rays sample too
//! coarsely.

use super::plan::PingPlan;
use crate::echo::has_coherent_echo;
use crate::trace::{Body, Goal, Stand};
use glam::{DVec3, Vec3};
use ground::error::{Error, Result};

/// Targets and bodies, where sound reaches them.
#[derive(Default)]
pub(super) struct Goals {
    pub targets: Vec<Goal>,
    pub bodies: Vec<Stand>,
    /// Which objects are among the bodies; empty: none.
    pub covered: Vec<bool>,
}

/// Limits on how fast and how far sound travels.
struct Reach {
    /// Greatest speed in the water, m/s.
    fastest: f64,
    /// Farthest distance from which echoes come, m: in a duct sound may travel longer than straight ahead, never
    /// shorter.
    farthest: f64,
}

impl Reach {
    fn new(plan: &PingPlan) -> Reach {
        let fastest = plan.column.end_speeds().fold(0.0, f64::max);
        Reach { fastest, farthest: plan.reach * fastest / plan.layout.believed_speed }
    }
}

impl PingPlan<'_> {
    /// Finds those from which echoes may come.
    ///
    /// # Errors
    /// A target that is larger than its distance.
    pub(super) fn find_goals(&self, goals: &mut Goals) -> Result<()> {
        let Goals { targets, bodies, covered } = goals;
        targets.clear();
        bodies.clear();
        covered.clear();
        let reach = Reach::new(self);
        self.find_targets(&reach, targets)?;
        let near = self.scene.bodies().iter().filter(|body| {
            body.sphere.is_none_or(|(middle, radius)| middle.distance(self.place()) - radius < reach.farthest)
        });
        bodies.extend(near.filter_map(|&body| self.find_body(&reach, body)));
        if !bodies.is_empty() {
            covered.resize(self.scene.extents.len(), false);
            bodies.iter().for_each(|stand| covered[stand.body.object as usize] = true);
        }
        Ok(())
    }

    /// The result of `place` for the time at which sound reaches the middle that it returns, and the distance of that
    /// from the sonar, m.
    fn when_reached<T>(&self, reach: &Reach, place: impl Fn(f64) -> Option<(T, DVec3)>) -> Option<(T, f64)> {
        /// Objects move at no more than a hundredth of the speed of sound.
        const PASSES: usize = 3;
        let moves = self.clock.as_ref().is_some_and(|clock| clock.of(1.0) != clock.of(0.0));
        let (mut time, mut found) = (self.time, None);
        for _ in 0..if moves { PASSES } else { 1 } {
            let Some((what, middle)) = place(time) else { break };
            let distance = middle.distance(self.place());
            found = Some((what, distance));
            time = self.time + distance / reach.fastest;
        }
        found
    }

    fn find_targets(&self, reach: &Reach, targets: &mut Vec<Goal>) -> Result<()> {
        let surfaces = &self.scene.surfaces;
        for target in &surfaces.targets {
            let row = &surfaces.rows[target.row as usize];
            let place = |time: f64| {
                let (place, _) = self.scene.transform_at(row.object, time, self.mask)?;
                let middle = place.transform_point3(target.middle) - self.scene.origin;
                Some(((middle, place.matrix3), middle))
            };
            let Some(((middle, turned), distance)) = self.when_reached(reach, place) else { continue };
            let radius = target.radius * turned.determinant().abs().cbrt();
            if distance - radius > reach.farthest {
                continue;
            }
            if radius > distance {
                let name = &surfaces.materials[row.material as usize].name;
                let found = format!(
                    "target, of a mesh of the material {name:?} with a radius of {radius:.3} m, {distance:.3} m away"
                );
                return Err(Error::invalid("sound.law", found, "for targets farther away than their radius"));
            }
            targets.push(Goal { row: target.row, middle });
        }
        Ok(())
    }

    /// A body where sound reaches it, if it needs tubes: it is smooth and has a coherent echo, or few rays would hit
    /// it.
    fn find_body(&self, reach: &Reach, body: Body) -> Option<Stand> {
        let place = |time: f64| {
            let stand = self.scene.stand(body, time, self.mask)?;
            Some((stand, stand.middle))
        };
        let (stand, distance) = self.when_reached(reach, place)?;
        let radius = stand.radius();
        // A body that surrounds the sonar is not in front of it.
        if distance < 2.0 * radius || distance - radius > reach.farthest {
            return None;
        }
        let towards = (stand.middle - self.place()) / distance;
        let aim = self.rotation().transpose() * towards.as_vec3();
        let size = (radius / distance) as f32;
        let in_phase = body.mirrors && has_coherent_echo(radius, self.wavelength());
        // A body wider than the beam is hit by the rays of the ping where it is received, as they are in the beam.
        let narrow = size < self.transducer.narrowest as f32;
        if !(in_phase || narrow) || narrow && !self.is_received(aim) {
            return None;
        }
        let [along, aside] = stand.outline(towards).map(DVec3::length);
        let part = 4.0 * along * aside / (std::f64::consts::PI * radius * radius);
        /// Number of rays that hit it: their echo is within 2 dB in 99 of 100 pings.
        const ENOUGH: f32 = 64.0;
        (in_phase || self.transducer.has_fewer_rays(ENOUGH / part as f32, aim, size)).then_some(stand)
    }

    /// Whether the sonar transmits in a direction (unit, sensor frame) and receives from there.
    fn is_received(&self, aim: Vec3) -> bool {
        /// log2 of the two-way power below which the rays of the ping are enough: -27 dB, the first side lobe of a line
        /// array, two-way.
        const LEAST: f32 = -9.0;
        self.transducer.towards(aim, aim).any(|(loud, _)| loud > LEAST)
    }
}
