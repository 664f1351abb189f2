//! Which marker to move, where to, and what is gained.
//!
//! Hundreds of moves are scored on images without noise; the few best are then measured like any cell, with the same draws as
//! the constellation as it is.

use std::fmt;

use nalgebra::Vector3;

use super::AssessOptions;
use super::budget;
use super::cell::{Cell, measure};
use super::draws::Draw;
use super::score::Scorer;
use super::stage::{Stage, across, extent_m};
use crate::geometry::Point;
use crate::target::{Marker, Target};

/// Moves that are reported.
const REPORTED: usize = 3;

/// Markers whose moves are tried: those at the rim and those in the middle, where a target has more.
const MOST_MOVED: usize = 8;

/// Lengths of moves within the plane, of the extent.
const SIDEWAYS_RATIOS: [f64; 2] = [0.12, 0.25];

/// Lengths of moves out of the plane, of the extent.
const OUTWARD_RATIOS: [f64; 3] = [0.1, 0.2, 0.3];

/// Directions of moves within the plane.
const DIRECTIONS: u32 = 8;

/// A marker keeps at least this distance from the others, of the extent.
const LEAST_DISTANCE_RATIO: f64 = 0.12;

/// A gain in the sum of both rates below this is not worth the glue, and may be chance.
const WORTHWHILE: f64 = 0.02;

/// A move of one marker.
#[derive(Clone, Debug, PartialEq)]
pub struct Advice {
    /// Position of the marker in the target.
    pub marker: usize,
    /// Its id.
    pub id: String,
    /// Where it is, in the target's space.
    pub from: Point<crate::geometry::space::Target>,
    /// Where to put it.
    pub to: Point<crate::geometry::space::Target>,
    /// Part of the move out of the front plane, towards the viewer.
    pub outward_m: f64,
    /// Before.
    pub before: Figures,
    /// After, with the same draws.
    pub after: Figures,
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let step = self.to.coords - self.from.coords;
        let sideways_m = (step.norm_squared() - self.outward_m * self.outward_m).max(0.0).sqrt();
        let mm = |metres: f64| format!("{:.0} mm", metres * 1e3);
        let towards = if self.outward_m > 0.0 { "towards the viewer" } else { "away from the viewer" };
        let outward = format!("{} out of the plane {towards}", mm(self.outward_m.abs()));
        let way = match (sideways_m > 1e-6, self.outward_m.abs() > 1e-6) {
            (true, true) => format!("{} sideways and {outward}", mm(sideways_m)),
            (true, false) => format!("{} sideways", mm(sideways_m)),
            (false, _) => outward,
        };
        // A negative zero would be written as -0.000.
        let to = self.to.coords.map(|c| if c.abs() < 5e-4 { 0.0 } else { c });
        let percent = |rate: f64| format!("{:.0} %", rate * 100.0);
        write!(
            f,
            "move {} {way}, to ({:.3}, {:.3}, {:.3}) m: flips {} -> {}",
            self.id,
            to.x,
            to.y,
            to.z,
            percent(self.before.flip_rate),
            percent(self.after.flip_rate),
        )?;
        if let Some((before, after)) = self.before.identified_rate.zip(self.after.identified_rate) {
            write!(f, ", identified {} -> {}", percent(before), percent(after))?;
        }
        if let Some((before, after)) = self.before.attitude_error_rad.zip(self.after.attitude_error_rad) {
            write!(f, ", attitude {:.1} -> {:.1} deg", before.to_degrees(), after.to_degrees())?;
        }
        Ok(())
    }
}

/// Means over the aspects at one range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Of [`Cell::flip_rate`]; 1 where an aspect gives no pose.
    pub flip_rate: f64,
    /// Of [`Cell::identified_rate`]; `None` where that was not simulated.
    pub identified_rate: Option<f64>,
    /// Of [`Cell::attitude_error_rad`], root mean square; `None` where no aspect gives a pose.
    pub attitude_error_rad: Option<f64>,
}

impl Figures {
    /// Over cells of one range.
    pub(super) fn of(cells: &[Cell]) -> Self {
        let mean = |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        let squares = cells.iter().filter_map(|cell| cell.attitude_error_rad).map(|error| error * error);
        Self {
            // No pose is no better than a wrong one.
            flip_rate: mean(cells.iter().map(|cell| cell.flip_rate.unwrap_or(1.0)).collect()).unwrap_or(1.0),
            identified_rate: mean(cells.iter().filter_map(|cell| cell.identified_rate).collect()),
            attitude_error_rad: mean(squares.collect()).map(f64::sqrt),
        }
    }

    /// What a move is to make small.
    fn loss(&self) -> f64 {
        self.flip_rate + self.identified_rate.map_or(0.0, |rate| 1.0 - rate)
    }
}

/// The best moves, the best first, and the figures of the target as it is.
pub(super) fn advice(
    stage: &Stage<'_>,
    range_m: f64,
    aspects_rad: &[f64],
    options: &AssessOptions,
) -> (Figures, Vec<Advice>) {
    let markers = stage.target.markers().len();
    let stays_flat = stays_flat(stage.target, options);
    let budget = budget::measuring(stage.target, stays_flat, budget::MEASURED, aspects_rad.len());
    let draws = Draw::first(budget.draws, markers);
    let figures = |stage: &Stage<'_>| {
        let cell = |aspect: &f64| measure(stage, range_m, *aspect, &draws, budget.identified_draws, options);
        Figures::of(&aspects_rad.iter().map(cell).collect::<Vec<_>>())
    };
    let before = figures(stage);
    let moves = moves(stage, options.keep_flat);
    let turns = budget::sorting_turns(stage.target, stays_flat, moves.len());
    let scorer = Scorer::new(range_m, aspects_rad, options, markers, turns);
    let as_it_is = scorer.score(stage);
    let mut scored: Vec<(f64, Move, Target)> = moves
        .into_iter()
        .filter_map(|step| {
            let moved = step.applied(stage.target)?;
            let score = scorer.score(&stage.with(&moved));
            (score < as_it_is).then_some((score, step, moved))
        })
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut measured: Vec<Advice> = Vec::new();
    for (_, step, moved) in best_of_each_kind(scored, &stage.front) {
        let after = figures(&stage.with(&moved));
        let marker = &stage.target.markers()[step.marker];
        if before.loss() - after.loss() >= WORTHWHILE {
            measured.push(Advice {
                marker: step.marker,
                id: marker.id.clone(),
                from: marker.position,
                to: moved.markers()[step.marker].position,
                outward_m: step.by.dot(&stage.front),
                before,
                after,
            });
        }
    }
    measured.sort_by(|a, b| a.after.loss().total_cmp(&b.after.loss()));
    measured.truncate(REPORTED);
    (before, measured)
}

/// Whether all moves leave the target flat.
pub(super) fn stays_flat(target: &Target, options: &AssessOptions) -> bool {
    options.keep_flat && target.spread().is_coplanar()
}

/// The best moves of different markers, half of them within the plane and half out of it as far as there are such: scores sort
/// moves of one kind better than they compare the kinds, and the advice is to leave a choice.
fn best_of_each_kind(scored: Vec<(f64, Move, Target)>, front: &Vector3<f64>) -> Vec<(f64, Move, Target)> {
    const CHOSEN: usize = budget::MEASURED - 1;
    let is_outward = |step: &Move| step.by.dot(front).abs() > 1e-9 * step.by.norm();
    let mut chosen: Vec<(f64, Move, Target)> = Vec::new();
    let mut spare = Vec::new();
    for candidate in scored {
        let step = candidate.1;
        if chosen.iter().any(|(_, known, _)| known.marker == step.marker && is_outward(known) == is_outward(&step)) {
            continue;
        }
        let of_kind = chosen.iter().filter(|(_, known, _)| is_outward(known) == is_outward(&step)).count();
        if of_kind < CHOSEN / 2 { chosen.push(candidate) } else { spare.push(candidate) }
    }
    spare.truncate(CHOSEN - chosen.len());
    chosen.extend(spare);
    chosen
}

/// A marker and by how much it is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Move {
    marker: usize,
    by: Vector3<f64>,
}

impl Move {
    fn applied(&self, target: &Target) -> Option<Target> {
        let mut markers = target.markers().to_vec();
        markers[self.marker].position = (markers[self.marker].position.coords + self.by).into();
        Target::checked(target.name(), markers).ok()
    }
}

/// Moves that keep the marker within the circle that the markers have now (the airframe may end there) and clear of the
/// others.
fn moves(stage: &Stage<'_>, keep_flat: bool) -> Vec<Move> {
    let target = stage.target;
    let extent_m = extent_m(target);
    let centre = target.spread().centre;
    // A flat target stays in its plane, whichever way its markers face.
    let out = if target.spread().is_coplanar() {
        let normal: Vector3<f64> = target.spread().axes.column(2).into_owned();
        if normal.dot(&stage.front) < 0.0 { -normal } else { normal }
    } else {
        stage.front
    };
    let [x, y] = across(&out);
    let sideways = SIDEWAYS_RATIOS.into_iter().flat_map(|ratio| {
        (0..DIRECTIONS).map(move |k| {
            let (sine, cosine) = (std::f64::consts::TAU * f64::from(k) / f64::from(DIRECTIONS)).sin_cos();
            (x * cosine + y * sine) * (ratio * extent_m)
        })
    });
    // A marker that faces the viewer can be raised on a mast, but not sunk into the airframe.
    let seen_from_both_sides = target.markers().iter().any(|marker| marker.normal.is_none());
    let outward = OUTWARD_RATIOS.into_iter().flat_map(|ratio| {
        let by = out * (ratio * extent_m);
        std::iter::once(by).chain(seen_from_both_sides.then_some(-by))
    });
    let steps: Vec<Vector3<f64>> = if keep_flat { sideways.collect() } else { sideways.chain(outward).collect() };
    let across_m = |p: &Vector3<f64>| (p - out * p.dot(&out)).norm();
    let reach_m = target.markers().iter().map(|m| across_m(&(m.position.coords - centre))).fold(0.0, f64::max);
    let is_possible = |step: &Move| {
        let moved = &target.markers()[step.marker];
        let place = moved.position.coords + step.by;
        let is_clear = |other: &Marker| {
            let radii = moved.radius_m.unwrap_or(0.0) + other.radius_m.unwrap_or(0.0);
            // As it is seen from the front: a mast in front of a marker hides it.
            across_m(&(other.position.coords - place)) > radii + LEAST_DISTANCE_RATIO * extent_m
        };
        let others = target.markers().iter().enumerate().filter(|(index, _)| *index != step.marker);
        across_m(&(place - centre)) <= reach_m * (1.0 + 1e-9) && others.into_iter().all(|(_, other)| is_clear(other))
    };
    movable(target)
        .into_iter()
        .flat_map(|marker| steps.iter().map(move |by| Move { marker, by: *by }))
        .filter(is_possible)
        .collect()
}

/// All markers, or of many the outermost and the innermost.
fn movable(target: &Target) -> Vec<usize> {
    let distance = |marker: &usize| (target.markers()[*marker].position.coords - target.spread().centre).norm();
    let mut order: Vec<usize> = (0..target.markers().len()).collect();
    if order.len() > MOST_MOVED {
        order.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        order.drain(MOST_MOVED / 2..order.len() - MOST_MOVED / 2);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::models::{demo_camera, wing_six};

    #[test]
    fn moves_stay_on_the_airframe_and_clear_of_other_markers() {
        let (camera, target) = (demo_camera(), wing_six());
        let stage = Stage::of(&camera, &target);
        let all = moves(&stage, false);
        let flat = moves(&stage, true);
        assert!(flat.len() > 10 && all.len() > flat.len());
        assert!(flat.iter().all(|step| step.by.z.abs() < 1e-12), "{flat:?}");
        // The markers face -z: a mast points there.
        assert!(all.iter().all(|step| step.by.z < 1e-12) && all.iter().any(|step| step.by.z < -0.2), "{all:?}");
        let reach = |t: &Target| {
            let centre = target.spread().centre;
            t.markers().iter().map(|m| (m.position.coords - centre).xy().norm()).fold(0.0, f64::max)
        };
        for step in &all {
            let moved = step.applied(&target).expect("a good target");
            assert!(reach(&moved) <= reach(&target) * 1.000_001, "{step:?}");
        }
    }
}
