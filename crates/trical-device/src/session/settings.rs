//! How to measure.

use trical_model::robot::tidy;
use trical_model::{Cell, Robot};

use crate::procedure::{ProcedureLimits, ProcedureOptions, Retreat};

/// How to measure. Lengths in m, speeds in m/s.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// A touch is accepted when its reading is shorter than this.
    pub epsilon: f64,
    /// Repeatability of the arm; an `epsilon` below it is warned about.
    pub repeatability: f64,
    /// Visits of every touch, for the recording's header: the plan has them all.
    pub visits: u32,
    /// Speed of the tool between the balls.
    pub travel_speed: f64,
    /// Speed of the tool at a ball.
    pub touch_speed: f64,
    /// Longest single correction.
    pub max_correction: f64,
    /// Longest sum of a touch's corrections.
    pub max_sum: f64,
    /// Most corrections of a touch.
    pub max_corrections: usize,
    /// Readings between which a stem touches its ball.
    pub stroke: [f64; 2],
    /// Temperature, degC, where the controller has no sensor.
    pub temp_c: Option<f64>,
    /// Mass added on the flange, kg.
    pub payload_kg: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            epsilon: 20e-6,
            repeatability: 10e-6,
            visits: 1,
            travel_speed: 0.1,
            touch_speed: 0.01,
            max_correction: 4.9e-3,
            max_sum: 8e-3,
            max_corrections: 10,
            stroke: [-5.9e-3, 5.9e-3],
            temp_c: None,
            payload_kg: None,
        }
    }
}

impl Settings {
    /// Refuses settings that no measurement has.
    ///
    /// # Errors
    /// One sentence: which, what was found, what is expected.
    pub fn check(&self) -> Result<(), String> {
        let [low, high] = self.stroke;
        for (name, value, least, most, unit, scale) in [
            ("tolerance of a touch", self.epsilon, 1e-7, 1e-3, "mm", 1e3),
            ("repeatability of the arm", self.repeatability, 0.0, 1e-3, "mm", 1e3),
            ("speed between the balls", self.travel_speed, 1e-4, 0.25, "mm/s", 1e3),
            ("speed at a ball", self.touch_speed, 1e-4, 0.25, "mm/s", 1e3),
            ("longest correction", self.max_correction, 1e-5, 0.05, "mm", 1e3),
            ("longest sum of corrections", self.max_sum, 1e-5, 0.1, "mm", 1e3),
            ("most that a touch is corrected", self.max_corrections as f64, 1.0, 1e3, "times", 1.0),
            ("lower end of the stroke", low, -0.1, 0.0, "mm", 1e3),
            ("upper end of the stroke", high, 0.0, 0.1, "mm", 1e3),
            ("temperature", self.temp_c.unwrap_or(20.0), -100.0, 200.0, "degC", 1.0),
            ("mass on the flange", self.payload_kg.unwrap_or(0.0), 0.0, 1e4, "kg", 1.0),
        ] {
            if !(least..=most).contains(&value) {
                return Err(format!(
                    "{name}: found {} {unit}, expected {} to {}",
                    tidy(value * scale),
                    tidy(least * scale),
                    tidy(most * scale)
                ));
            }
        }
        Ok(())
    }

    /// As the procedure takes them, for an arm and a cell. Nothing moves with these yet.
    #[must_use]
    pub fn options<'a>(&self, robot: &Robot, cell: &Cell) -> ProcedureOptions<'a> {
        ProcedureOptions {
            epsilon: self.epsilon,
            repeatability: self.repeatability,
            travel_speed: self.travel_speed,
            touch_speed: self.touch_speed,
            retreat: Retreat::Approach,
            tcp_in_flange: Some(cell.tool.tcp.into()),
            temp_c: self.temp_c,
            payload_kg: self.payload_kg,
            // as far as the indicators reach; the controller has limits of its own
            limits: ProcedureLimits {
                correction: self.max_correction,
                total_correction: self.max_sum,
                iterations: self.max_corrections,
                stroke: self.stroke,
                joints: robot.joints.iter().map(|j| (j.limits[0], j.limits[1])).collect(),
                ..ProcedureLimits::default()
            },
            ..ProcedureOptions::default()
        }
    }

    /// As a recording's header has them, in mm.
    pub(super) fn named(&self) -> impl Iterator<Item = (String, String)> {
        let mm = |x: f64| tidy(x * 1e3).to_string();
        [
            ("epsilon_mm", mm(self.epsilon)),
            ("repeatability_mm", mm(self.repeatability)),
            ("visits", self.visits.to_string()),
            ("travel_mm_s", mm(self.travel_speed)),
            ("touch_mm_s", mm(self.touch_speed)),
            ("max_correction_mm", mm(self.max_correction)),
            ("max_sum_mm", mm(self.max_sum)),
        ]
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
    }

    /// A warning where touches may not converge.
    pub(super) fn too_tight(&self) -> Option<String> {
        (self.epsilon < self.repeatability).then(|| {
            format!(
                "the tolerance of a touch, {} mm, is below the arm's repeatability, {} mm: touches may not converge",
                tidy(self.epsilon * 1e3),
                tidy(self.repeatability * 1e3)
            )
        })
    }
}
