//! Every threshold of a diagnosis, with its reason. Sizes that are an effect's own stand in its file.

// What the recordings have

/// Moments at which a change is looked for.
pub const CHANGE_POINTS: usize = 60;

/// Loads below this (N m) are none.
pub const NO_LOAD_NM: f64 = 0.1;

/// What the most loaded joint of a small arm carries (root mean square, N m): sizes of effects that go with torque are known of such.
pub const SMALL_ARM_LOAD_NM: f64 = 25.0;

/// Time constants with which an arm may warm up, s; longer ones by doubling, as long as the recording is.
pub const WARM_UP_S: [f64; 5] = [400.0, 800.0, 1600.0, 3200.0, 6400.0];

/// The same where nothing tells how long a pose took, as parts of the recording.
pub const WARM_UP_PARTS: [f64; 7] = [1.0 / 32.0, 1.0 / 16.0, 0.125, 0.25, 0.5, 1.0, 2.0];

/// How long a touch takes, s: what a rate in time is at each pose where there is no clock.
pub const SECONDS_PER_TOUCH: f64 = 20.0;

/// Indicator readings must spread this many times beyond the residual noise before their gain can be asked for. The noise of
/// a reading stands in the residual and in the regressor, which biases a gain by -(noise / spread)^2: by 1 % at ten.
pub const READING_SPREAD: f64 = 10.0;

/// Readings that spread further than this (m) were not nulled, however large the errors of the fit are: a stem that is driven to zero ends
/// within some hundredths of a millimetre.
pub const NULLED_WITHIN_M: f64 = 1e-3;

// Rejected rows

/// Robust standard deviations beyond which a measurement is an outlier of a fitted model.
pub const OUTLIER_SIGMAS: f64 = 6.0;

/// More than this share of a session are no outliers but something that the model lacks.
pub const OUTLIER_SHARE: f64 = 0.03;

/// The same of a small session: so many rows, and no more than one in so many.
pub const OUTLIERS: usize = 4;

/// Repeats that would happen by chance less often than this in the whole data set are stale.
pub const REPEATS_BY_CHANCE: f64 = 0.02;

// Recordings of many poses

/// Poses that are searched. An effect that this many do not show at three standard deviations takes less than two thousandths off the errors.
pub const SEARCHED_POSES: usize = 1024;

/// Neighbouring poses that a sample takes together.
pub const RUN_POSES: usize = 16;

// Correlated noise

/// Correlated noise must better the likelihood of white noise by so many nats, as what has no name must that of names.
pub const CORRELATED_NATS: f64 = 5.0;

/// A process is noise where recordings hold so many of its correlation lengths; beyond, it is a drift, and the effects say of what.
pub const CORRELATION_LENGTHS: f64 = 10.0;

/// Correlations from one measurement to the next that are tried.
pub const AUTOCORRELATIONS: [f64; 10] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98];

/// Shares of the noise's variance that may be white.
pub const WHITE_SHARES: [f64; 6] = [0.0, 0.25, 0.5, 0.7, 0.85, 0.95];

// The linear fit

/// Columns whose length after projection is below this fraction of their length are absorbed by the fit.
pub const ABSORBED_SHARE: f64 = 1e-3;

// Locators

/// A locator must beat every name by this many nats.
pub const UNNAMED_PRICE_NATS: f64 = 5.0;

/// How far a joint may be off without a name, rad (0.02 deg): the prior of each knot of a curve.
pub const UNNAMED_SIZE_RAD: f64 = 0.02 * std::f64::consts::PI / 180.0;

/// Where a curve without a name stands beside a name, it is tried with knots of this share of that size too.
pub const UNNAMED_REST: f64 = 0.2;

/// A curve of which a name says so large a share is that name and a rest: one that begins in the middle of the range of its variable is said to four
/// fifths by what grows over all of it.
pub const NAMED_SHARE: f64 = 0.9;

/// Thresholds tried for each variable.
pub const STEP_THRESHOLDS: usize = 30;

/// Thresholds tried for growth are the inner ones of so many quantiles.
pub const GROWTH_QUANTILES: usize = 9;

/// Places at which something local is looked for.
pub const LOCAL_CENTRES: usize = 32;

/// How far something local reaches to either side of its centre, as parts of the joint's stroke.
pub const LOCAL_REACHES: [f64; 3] = [1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0];

/// Values that something local must have.
pub const LOCAL_VALUES: usize = 4;

/// Knots of a free curve.
pub const CURVE_KNOTS: usize = 8;

/// Knots of curves of a joint's own angle that are narrow: the finer ones where there are [`VALUES_PER_KNOT`] values for each knot. An
/// encoder's own error has many waves, and is no single one of them.
pub const FINE_CURVE_KNOTS: [usize; 2] = [16, 32];

/// Values of an angle that each knot of the finer curves must have.
pub const VALUES_PER_KNOT: usize = 20;

// Encoder curves

/// Waves of an encoder's curve: fewer than the first are no curve, more than the second were not seen on real arms.
pub const ENCODER_WAVES: (usize, usize) = (6, 50);

/// Waves of a curve that is smoother than most: one with so many is asked about too, and costs what it is worth.
pub const SMOOTH_WAVES: usize = 12;

/// Poses for every wave: fewer do not determine its two coefficients.
pub const POSES_PER_WAVE: usize = 12;

/// Candidates with more coefficients than this are chosen first, then held while leaner ones are searched.
pub const CURVE_COEFFICIENTS: usize = 10;

/// Candidates that are tried beside each other before curves are held.
pub const TRIED_WITH_CURVES: usize = 14;

/// Each octave of an encoder's waves counts as so many coefficients of the usual size beside those that are fitted: a single wave does not
/// decide.
pub const OWN_SIZE_WEIGHT: f64 = 4.0;

/// Sizes of waves are learnt until no factor changes by more than this share.
pub const SIZE_SETTLED: f64 = 0.02;

/// Rounds of that at most.
pub const SIZE_ROUNDS: usize = 20;

/// Shares of the size that the likelihood says waves of curves have, tried in turn on angles that a fit did not visit.
pub const CURVE_SHARES: [f64; 4] = [1.0, 0.6, 0.36, 0.22];

/// So many of the curves, the first that were found, say which share it is.
pub const CURVES_ASKED: usize = 3;

/// Neighbours of a gear's number and of its multiples, this near in cycles a turn, are the same line, modulated.
pub const GEAR_SIDEBANDS: f64 = 2.0;

/// Numbers below this are no gear's, where there is no curve of an encoder beside them: few wheels have fewer teeth.
pub const FEWEST_TEETH: f64 = 10.0;

/// A joint has its gear's number and perhaps that of another stage: so many lines of no one gear are an encoder's.
pub const LINES_OF_NO_GEAR: usize = 3;

/// Of a small number they are nearer, as a share of it: else too many lines would be its neighbours.
pub const GEAR_SIDEBANDS_SHARE: f64 = 0.06;

/// The strongest line of a gear is at its number or at a multiple up to this.
pub const GEAR_MULTIPLES: u32 = 2;

/// The same where its number may be small.
pub const GEAR_MULTIPLES_OF_FEW: u32 = 4;

/// The smallest number of a gear whose lines are told from an encoder's waves: of smaller ones too many lines are multiples by chance.
pub const SMALLEST_GEAR: f64 = 50.0;

// Frequencies

/// Cycles per turn that gears have.
pub const GEAR_CYCLES: (u32, u32) = (10, 300);

/// Beyond gears: a period of 0.01 deg, the finest that joint angles tell.
pub const FINEST_CYCLES: u32 = 36_000;

/// Strongest frequencies of each joint that are tried.
pub const PEAKS_PER_JOINT: usize = 5;

// Finer scans

/// A free curve may stand for a step that the scan missed: so many steps are tried all along its variable.
pub const STEPS_ALONG_CURVE: usize = 60;

/// Softnesses, kinks and time constants of a smaller ratio are not told apart.
pub const SAME_SCALE_RATIO: f64 = 1.15;

/// Points of an axis that are nearer to each other than this share of its offset are not told apart.
pub const SAME_POINT_SHARE: f64 = 0.05;

/// A step is refined at so many places between its neighbours in the scan.
pub const STEPS_BETWEEN_NEIGHBOURS: usize = 20;

/// Something local is refined at so many places between its neighbours in the scan.
pub const LOCAL_CENTRES_BETWEEN: usize = 4;

// Selection

/// A candidate must better the criterion by this many nats. With the prior spread over all candidates, of 300 effect-free data sets of the
/// proof none passes it.
pub const EVIDENCE_NATS: f64 = 2.0;

/// Most effects that are looked for.
pub const MOST_EFFECTS: usize = 40;

/// Candidates looked at as second members of a pair.
pub const PAIR_SHORTLIST: usize = 24;

/// Pairs are merged among at most so many.
pub const MERGED_AMONG: usize = 12;

/// Evidence that differs by less, nats, is the same: rounding must not decide between columns that are (steps between which no row
/// is left).
pub const SAME_EVIDENCE_NATS: f64 = 1e-6;

/// Leaner candidates that are tried, with another one, in the place of a rich one.
pub const LEANER_TRIED: usize = 3;

/// Replacements that are weighed together, the best first: beside those that were made the others are worth less than they were.
pub const SWAPS_WEIGHED: usize = 6;

/// So many together may take the place of a curve, without a name or an encoder's, that covered several effects of its joint: no two may say as much.
pub const LEANER_FOR_CURVES: usize = 4;

// Rounds

/// Rounds of selection and exact refit at most: two choices that lead to each other would never end.
pub const MOST_ROUNDS: usize = 10;

/// A candidate that others beat by so much, nats, is not searched again before the last round: to linearize at another fit moves evidence
/// by less where effects are small beside the arm.
pub const IDLE_NATS: f64 = 10.0;

/// A round that takes a smaller share than this off the standard deviation of the residuals that any round before it left is the last: an effect
/// that 150 touches show at three standard deviations takes 1 %.
pub const SETTLED_SHARE: f64 = 0.002;

/// The same of a round among few candidates: one among all follows it.
pub const SETTLED_AMONG_FEW: f64 = 0.01;

/// The same of rounds that others follow, when curves were held or let go, rows came back, or names were doubted: only the last need be exact.
pub const ROUGHLY_SETTLED: f64 = 0.1;

/// How often effects and the correlation of the noise are chosen in turn.
pub const NOISE_ALTERNATIONS: usize = 4;

/// What is left of the means of readings of one pose is told where it is larger than these by so much: less is no matter of the arm.
pub const BEYOND_READINGS: f64 = 1.5;

/// So many rejected rows that one number explains are no outliers.
pub const ROWS_ALIKE: usize = 3;

/// Robust standard deviations beyond which a row is a gross error before anything is identified.
pub const GROSS_ERROR_SIGMAS: f64 = 30.0;

// Specification test

/// Curves with phases drawn by chance beside which an encoder's is seen, ...
pub const PHASE_DRAWS: usize = 4999;

/// ... at so many of the angles that were visited, at most.
pub const PHASE_ANGLES: usize = 250;

/// Prior odds that what happens at a place is not in the catalogue.
pub const OUTSIDE: f64 = 0.03;

/// Knots of a probe's curve.
pub const PROBE_KNOTS: usize = 7;

/// A place whose probes have a smaller p-value than this lacks something: names lose their privilege there.
pub const LACK_OF_FIT_P: f64 = 1e-3;

/// What is left at a place is considerable if it is this share of what its names explain: it then puts them in even doubt.
pub const CONSIDERABLE_SHARE: f64 = 0.1;

/// The share of its past that a fading history of moves keeps with every move.
pub const HISTORY_KEPT: f64 = 0.8;

// Findings

/// A name less probable than this is doubted: what probes find at its place is told too.
pub const DOUBTED_BELOW: f64 = 0.9;

/// The last so many percent of each session's poses are predicted by a fit to those before.
pub const LAST_PERCENT: usize = 25;

/// Draws of the Bayesian bootstrap over blocks of poses: shares are then known to 3 %.
pub const BOOTSTRAP_DRAWS: usize = 400;

/// Angles of a joint that are nearer to each other are the same, rad: programs come back to them, and the arm stands where it can.
pub const SAME_ANGLE: f64 = 0.2 * std::f64::consts::PI / 180.0;

/// At fewer different angles any curve of a joint's own angle looks like many others: zero and ratio take up two of them, a wave two more, and of
/// hundreds of numbers of cycles some pass through the rest.
pub const ANGLES_FOR_CURVES: usize = 12;

/// Alternatives that are set against a finding, beside what has no name at its place and nothing.
pub const ALTERNATIVES: usize = 8;

/// How often the data are halved, to search each half by itself.
pub const HALVED: usize = 4;

/// Rows that a half needs to be searched, for each parameter.
pub const HALF_ROWS: f64 = 3.0;

/// A finding must better the log score of unseen blocks by this many standard errors of that gain; else modelling it does not pay. An
/// effect of lambda 6 gains 18 nats, known to 6.
pub const PAYS_ERRORS: f64 = 1.0;

/// What happens in the course of the sessions may move measurements so many times as much as the plain model errs, as variances. Beyond that the
/// arm's own parameters say most of it as well: textbooks call variance inflation factors of 5 to 10 collinear (Marquardt 1970).
pub const MOST_INFLATION: f64 = 5.0;

/// A loss by so many standard errors in one proof (blocks, the last quarter, places) is more than chance, whatever the others gain.
pub const HARMS_ERRORS: f64 = 2.0;

/// Logistic curves from shares to probabilities, of place, of place and family, of place and effect: constant; factors of the share's logit, of
/// the logit of the halves that found it, of the logarithm of the number of findings where they did not; factor of the share's logit where no
/// halves were searched (see `probability`). Learnt by `proof/recalibrate.py` on 943 findings of 650 cases, 176 of them on real recordings (seeds
/// 20261126 and 20261128). On cases that they were not learnt on, real ones without any of their arm, the calibration error of `confidence`
/// falls from 0.048 to 0.019 on drawn arms and from 0.121 to 0.075 on real ones; of 42 real findings at 0.9 and more 2 are wrong, of 586 drawn
/// ones 20.
pub const RECALIBRATION: [[f64; 5]; 3] =
    [[1.43, 0.63, 0.60, -0.30, 1.51], [0.55, 0.48, 0.61, -0.33, 1.10], [0.44, 0.50, 0.48, -0.22, 1.19]];

/// Two whose scores of all blocks differ by less, nats, predict the same.
pub const TWIN_NATS: f64 = 1.0;

/// Rivals of a finding that are told at most.
pub const MOST_RIVALS: usize = 8;

/// Signatures shorter than this many standard deviations of the noise cannot be seen.
pub const VISIBLE_LAMBDA: f64 = 3.0;

/// Candidates within this many nats of a finding are rivals.
pub const RIVAL_NATS: f64 = 5.0;

/// Unless this share of what they say is left beside the finding: they say something else then.
pub const RIVAL_LEFT_SHARE: f64 = 0.5;

/// What probes find at a place where nothing was modelled is told where it is less likely than this to be chance.
pub const REMAINDER_P: f64 = 1e-5;

/// A probe that is better by so many nats than the curves of its place is told beside them.
pub const PROBE_BETTER_NATS: f64 = 3.0;

/// No claim is surer than this.
pub const LARGEST_CONFIDENCE: f64 = 0.99;

/// The same of a name that no halves were searched for: of 194 names said at 0.95 and more by the shares alone (arms of a simulator with which nothing here was
/// learnt) 187 were right, of 456 that halves say, too, 452.
pub const LARGEST_ALONE: f64 = 0.97;

// Rivals

/// Rivals of one finding that are set against it.
pub const RIVALS_COMPARED: usize = 4;

/// A finding surer than this needs no more measurements.
pub const SURE_ENOUGH: f64 = 0.9;
