//! Where a turn leads: our aircraft from the moment at which it begins to bank.

use nalgebra::{Vector2, Vector3};

use super::manoeuvre::Manoeuvre;

/// A turn to one side.
#[derive(Clone, Debug)]
pub(super) struct Path {
    speed_mps: f64,
    /// 1 to the right, -1 to the left.
    sign: f64,
    turn_rate_radps: f64,
    roll_in: RollIn,
    /// When the turn ends, and how far it led.
    pub end_s: f64,
    max_turn_rad: f64,
}

/// The first part, in which the bank grows.
#[derive(Clone, Debug)]
struct RollIn {
    roll_rate_radps: f64,
    /// `g / (V p)`: the turn is `-gain ln(cos(p t))`.
    gain: f64,
    /// When it is over, by the full bank or by the end of the turn.
    end_s: f64,
    /// Positions at even times up to the end, along the course and aside.
    knots: Vec<Vector2<f64>>,
}

/// Panels over which the roll-in is integrated, each with five points: a panel turns by a few degrees at most.
const PANELS: u32 = 32;

/// Abscissae and weights of Gauss and Legendre for five points on [-1, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.0, 128.0 / 225.0),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

impl Path {
    /// At this speed, to the right if `to_right`.
    pub(super) fn of(manoeuvre: &Manoeuvre, speed_mps: f64, to_right: bool) -> Self {
        let turn_rate_radps = manoeuvre.turn_rate_radps(speed_mps);
        let max_turn_rad = manoeuvre.max_turn_rad();
        let roll_in = RollIn::of(manoeuvre, speed_mps);
        let rest_rad = (max_turn_rad - roll_in.turned_rad(roll_in.end_s)).max(0.0);
        let end_s = roll_in.end_s + if roll_in.ends_turn(manoeuvre) { 0.0 } else { rest_rad / turn_rate_radps };
        let sign = if to_right { 1.0 } else { -1.0 };
        Self { speed_mps, sign, turn_rate_radps, roll_in, end_s, max_turn_rad }
    }

    /// Turned so far, rad, without sign.
    pub(super) fn turned_rad(&self, time_s: f64) -> f64 {
        if time_s >= self.end_s {
            return self.max_turn_rad;
        }
        let rolled_s = time_s.min(self.roll_in.end_s);
        self.roll_in.turned_rad(rolled_s) + self.turn_rate_radps * (time_s - rolled_s)
    }

    /// Velocity, m/s.
    pub(super) fn velocity_mps(&self, time_s: f64) -> Vector3<f64> {
        let turned = self.turned_rad(time_s);
        Vector3::new(turned.cos(), self.sign * turned.sin(), 0.0) * self.speed_mps
    }

    /// Place from where it began, m, up to the end of the turn.
    pub(super) fn place_m(&self, time_s: f64) -> Vector3<f64> {
        let time_s = time_s.clamp(0.0, self.end_s);
        let rolled_s = time_s.min(self.roll_in.end_s);
        let start = self.roll_in.turned_rad(rolled_s);
        // Over a chord of a circle: of its length, in the direction halfway.
        let half_rad = 0.5 * self.turn_rate_radps * (time_s - rolled_s);
        let chord_s = (time_s - rolled_s) * sinc(half_rad);
        let (sine, cosine) = (start + half_rad).sin_cos();
        let place = self.roll_in.place_s(rolled_s) + Vector2::new(cosine, sine) * chord_s;
        Vector3::new(place.x, self.sign * place.y, 0.0) * self.speed_mps
    }
}

fn sinc(angle_rad: f64) -> f64 {
    if angle_rad.abs() < 1e-8 { 1.0 } else { angle_rad.sin() / angle_rad }
}

impl RollIn {
    fn of(manoeuvre: &Manoeuvre, speed_mps: f64) -> Self {
        let Some(roll_rate_radps) = manoeuvre.roll_rate_radps() else {
            return Self { roll_rate_radps: 0.0, gain: 0.0, end_s: 0.0, knots: Vec::new() };
        };
        let gain = super::GRAVITY_MPS2 / (speed_mps * roll_rate_radps);
        // The bank at which the turn is over, if the full one is not reached before.
        let bank_rad = (-manoeuvre.max_turn_rad() / gain).exp().acos().min(manoeuvre.bank_rad());
        let mut roll_in = Self { roll_rate_radps, gain, end_s: bank_rad / roll_rate_radps, knots: Vec::new() };
        let panel_s = roll_in.end_s / f64::from(PANELS);
        let mut place = Vector2::zeros();
        roll_in.knots = (0..=PANELS)
            .map(|panel| {
                let from_s = f64::from(panel) * panel_s;
                let here = place;
                place += roll_in.panel_s(from_s, from_s + panel_s);
                here
            })
            .collect();
        roll_in
    }

    fn ends_turn(&self, manoeuvre: &Manoeuvre) -> bool {
        self.end_s > 0.0 && self.end_s < manoeuvre.roll_in_s() * (1.0 - 1e-12)
    }

    fn turned_rad(&self, time_s: f64) -> f64 {
        -self.gain * (self.roll_rate_radps * time_s).cos().ln()
    }

    /// Integral of the direction over a panel: the way at a speed of one.
    fn panel_s(&self, from_s: f64, to_s: f64) -> Vector2<f64> {
        let (middle, half) = (0.5 * (from_s + to_s), 0.5 * (to_s - from_s));
        GAUSS
            .iter()
            .map(|(at, weight)| {
                let (sine, cosine) = self.turned_rad(middle + half * at).sin_cos();
                Vector2::new(cosine, sine) * (weight * half)
            })
            .sum()
    }

    /// The way so far at a speed of one.
    fn place_s(&self, time_s: f64) -> Vector2<f64> {
        let panel_s = self.end_s / f64::from(PANELS);
        if !(panel_s > 0.0) {
            return Vector2::zeros();
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to the number of panels")]
        let panel = (time_s / panel_s).clamp(0.0, f64::from(PANELS)) as usize;
        let knot = self.knots.get(panel).copied().unwrap_or_default();
        knot + self.panel_s(panel as f64 * panel_s, time_s)
    }
}
