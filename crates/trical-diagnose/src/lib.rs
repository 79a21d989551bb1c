//! Diagnosis: does the model explain the data to within the noise; if not, where does it fail, which physics does that, how
//! sure is that, and what happens to the error on data that the fit did not see once it is modelled.
//!
//! Modules stand in the order of what uses what: each imports only modules above it.
//!
//! | module | holds |
//! |---|---|
//! | [`options`] | what is asked |
//! | [`settings`] | every threshold with its reason |
//! | [`statistics`] | tests and criteria |
//! | [`covariates`] | what the recordings have: time, temperature, loads, senses of motion |
//! | [`correlated_noise`] | noise that is correlated from one measurement to the next |
//! | [`effect_id`] | the list of effects |
//! | [`candidate`] | one explanation that can be tried |
//! | [`effects`], [`catalogue`] | the effects, one file each; what of them can be tried on the data |
//! | [`locators`] | what finds a mismatch without a name |
//! | [`linear`] | the linearized fit: signatures after projection, evidence, held-out errors |
//! | [`periodogram`], `refine` | which frequencies a joint's error has; finer shapes between those of a scan |
//! | [`selection`] | which candidates the residual asks for |
//! | [`specification_test`] | whether a name says all that happens at its place |
//! | [`rejection`] | stale rows and outliers |
//! | [`probability`], `parts` | how probable a name is: shares of what could be said, replication, recalibration; scores of unseen blocks |
//! | [`halves`] | what halves of the data say, searched by themselves |
//! | [`diagnosis`], `findings` | the result; from what was chosen to it |
//! | [`verdict`], `words` | what it comes to, in plain sentences |
//! | [`alternatives`] | between what the data cannot decide |
//! | `rounds` | rounds of selection and refit |
//! | `cautions`, `proving` | what should make one look twice; from what was chosen to findings with their proof |
//! | [`procedure`] | the whole of it |
//! | [`joint_choice`] | the same, with joints as read and as commanded |
//! | [`truth`] | true arms for a virtual cell, drawn by chance, and effects hidden in them |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod alternatives;
pub mod candidate;
pub mod catalogue;
mod cautions;
pub mod correlated_noise;
pub mod covariates;
pub mod diagnosis;
pub mod effect_id;
pub mod effects;
mod findings;
pub mod halves;
pub mod joint_choice;
pub mod linear;
pub mod locators;
pub mod options;
mod parts;
pub mod periodogram;
mod phases;
pub mod probability;
pub mod procedure;
mod proving;
mod refine;
pub mod rejection;
mod rounds;
pub mod selection;
pub mod settings;
pub mod specification_test;
pub mod statistics;
#[cfg(test)]
mod test_data;
pub mod truth;
pub mod verdict;
mod words;

pub use alternatives::Undecided;
pub use diagnosis::{
    Baseline, Blind, Coefficient, Diagnosis, Evidence, Final, Finding, Rival, RowKind, Unexplained, Verdict, VerdictRow,
};
pub use effect_id::{Cause, EffectId};
pub use joint_choice::diagnose_recordings;
pub use options::Options;
pub use probability::Replicated;
pub use procedure::diagnose;
