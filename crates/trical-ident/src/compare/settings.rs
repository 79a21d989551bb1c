//! Every threshold of a comparison, with its reason.

/// So often may something be said to have changed where nothing has.
pub const FALSE_ALARMS: f64 = 0.02;

/// Chance that a change of the size that is called visible is found.
pub(super) const FOUND: f64 = 0.9;

/// A claim moves the tool by at least this share of the old model's own errors, root mean square: what an old model does not know of the
/// arm differs from poses to poses, and among many measurements passes for a change.
pub(super) const SHARE: f64 = 0.35;

/// What an explanation adds to those that were taken is this share of it at least, or it is no other one: a joint's zero may be all but the tool's
/// turn about the same axis, and would come out at hundreds of degrees.
pub(super) const NEW_SHARE: f64 = 0.01;

/// Of more measurements than this some stand for all: they tell more than enough.
pub(super) const MEASUREMENTS: usize = 240;

/// One measurement among more than this is not tried as a wrong one: many small ones would be.
pub(super) const FEW: usize = 60;

/// Degrees of freedom of Student's t that single measurements follow: what a calibration lacks of the arm is several times larger at some
/// places than at most others, so that its errors have longer tails than those of an instrument.
pub(super) const TAILS: f64 = 8.0;

/// A comparison is linear in what changed: of a tool that turned by more than this the rest is not told rightly.
pub(super) const FAR_TURNED_DEG: f64 = 5.0;

/// Measurements that scatter so many times as much as in the old session are worth a sentence, and so many times do not fit the model: something
/// changed that none of the explanations is.
pub(super) const MORE_SCATTER: f64 = 1.3;
pub(super) const NO_FIT: f64 = 3.0;

/// What was taken makes room for what has so much more evidence in its place, nats.
pub(super) const CLEARLY_BETTER: f64 = 1.0;

/// Most changes that are looked for.
pub(super) const CHANGES: usize = 4;

/// Where no change at one place of the arm brings a coordinate closer than this, m, and than so many times the old session's noise,
/// the arm is another one, or the recording is in other units: a bent link leaves some millimetres.
pub(super) const ANOTHER_ARM: (f64, f64) = (1e-2, 100.0);

/// A change that would have to be larger than this to be found is not called visible: only its share that something else does not take up
/// is seen at all.
pub(super) const LARGEST_MM: f64 = 20.0;
pub(super) const LARGEST_DEG: f64 = 2.0;

/// A calibration that leaves so many times the usual noise of the instrument lacks something.
pub(super) const UNUSUAL: f64 = 3.0;

/// A mean error of the new measurements beyond so many times what the calibration left is no such lack.
pub(super) const BEYOND: f64 = 10.0;

/// By what share of themselves the links of an arm grow with each kelvin: between steel's and aluminium's.
pub(super) const EXPANSION: f64 = 18e-6;

/// Where one of two temperatures was not recorded they differ by so much, K: rooms do from day to day.
pub(super) const OTHER_DAY: f64 = 2.0;

/// From so much on, K, another temperature is told.
pub(super) const WARMER: f64 = 1.0;
