//! How far something that was learnt about an arm reaches: to every session, or to one.

use serde::{Deserialize, Serialize};

use crate::basis::{Basis, Shape, Variable};
use crate::term::{Site, Term};

/// What a term belongs to, and so to which recordings what it says applies. One recording is one session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    /// The arm itself: geometry, compliance, gears, encoders, bearings. Holds in every session and in programs.
    Arm,
    /// Tool, measuring frame, balls, payload, gauge: constant in a session, set up anew for another.
    Setup,
    /// What happened in the course of one session: steps, drifts, warming up.
    Course,
    /// How the joints were read when they were recorded.
    Reading,
}

impl Term {
    /// A jump of the setup (a tool that slipped, balls that were pushed) as it is from then on: it stays so until somebody sets up anew. `None` for
    /// anything else.
    #[must_use]
    pub fn after_its_session(&self) -> Option<Self> {
        let basis = Basis { of: Variable::Nothing, shape: Shape::One, session: None, ..self.basis };
        let jumps = matches!(self.basis.shape, Shape::Step { .. }) && self.scope() == Scope::Course;
        Some(Self { basis, ..self.clone() }).filter(|after| jumps && after.scope() == Scope::Setup)
    }

    /// What this term belongs to: by what its basis looks at, then by where it acts.
    #[must_use]
    pub fn scope(&self) -> Scope {
        match self.basis.of {
            Variable::Time | Variable::Seq => Scope::Course,
            Variable::Lag { .. } => Scope::Reading,
            Variable::Reading { .. } => Scope::Setup,
            _ => match self.site {
                Site::Base(_)
                | Site::Tool(_)
                | Site::Target { .. }
                | Site::Fixture(_)
                | Site::Ball { .. }
                | Site::Frame { .. }
                | Site::Payload(_)
                | Site::Anchor { .. }
                | Site::LengthZero { .. } => Scope::Setup,
                _ if self.basis.session.is_some() => Scope::Setup,
                _ => Scope::Arm,
            },
        }
    }
}
