//! Checks of a whole motion, with a proof: between two checked instants nothing can come closer than half the margin.

use trical_model::{Joints, MAX_JOINTS, Pose, Workspace};

use super::{CollisionModel, Contact};

/// Scratch space of one thread.
#[derive(Clone, Debug)]
pub struct MotionWorkspace {
    pub(super) ws: Workspace,
    pub(super) links: Vec<Pose>,
    /// Intervals still to be cleared: middle, half width, and their pairs in `active`.
    stack: Vec<(f64, f64, usize, usize)>,
    active: Vec<u32>,
    /// Configurations that were looked at, for statistics.
    pub configurations: u64,
}

impl MotionWorkspace {
    /// For this model.
    #[must_use]
    pub fn new(model: &CollisionModel) -> Self {
        Self {
            ws: model.forward().workspace(),
            links: vec![Pose::identity(); model.joints + 1],
            stack: Vec::new(),
            active: Vec::new(),
            configurations: 0,
        }
    }

    /// Scratch space for the model's forward function.
    pub fn forward(&mut self) -> &mut Workspace {
        &mut self.ws
    }
}

impl CollisionModel {
    /// Two bodies that come too close on the straight way in joint space from `from` to `to`, both ends included; `None`
    /// proves that every pair stays at least half the margin apart throughout, and the whole margin wherever it was looked.
    ///
    /// Adaptive subdivision: in the middle c of an interval of half width h (in parts of the motion) a pair is d apart. Its
    /// distance changes by at most `v = sum_k |dq_k| lever_k` over the motion, so with `d - v h >= margin / 2` the pair is
    /// done with for the whole interval; the other pairs go on into both halves. A pair closer than the margin ends the
    /// search. Intervals need not get shorter than `h = margin / (2 v)`, so it ends always.
    pub fn check_motion(
        &self,
        from: &Joints,
        to: &Joints,
        touched: Option<usize>,
        scratch: &mut MotionWorkspace,
    ) -> Option<Contact> {
        if let Some(hit) = self.check_joints(to, touched, scratch).or_else(|| self.check_joints(from, touched, scratch))
        {
            return Some(hit);
        }
        scratch.configurations += 2;
        let MotionWorkspace { ws, links, stack, active, configurations } = scratch;
        let mut dq = [0.0; MAX_JOINTS];
        for (d, (a, b)) in dq.iter_mut().zip(from.iter().zip(to)) {
            *d = b - a;
        }
        let floor = 0.5 * self.margin;
        stack.clear();
        active.clear();
        active.extend((0..self.pairs.len()).filter(|k| !self.pairs[*k].allowed(touched)).map(|k| k as u32));
        stack.push((0.5, 0.5, 0, active.len()));
        while let Some((middle, half, start, end)) = stack.pop() {
            // whatever lies beyond belonged to intervals that are done
            active.truncate(end);
            let mut q = *from;
            for (x, d) in q.iter_mut().zip(&dq) {
                *x += middle * d;
            }
            self.place(&q, ws, links);
            *configurations += 1;
            for at in start..end {
                let k = active[at];
                let pair = &self.pairs[k as usize];
                let speed: f64 = pair.speed.iter().zip(&dq).map(|(v, d)| v * d.abs()).sum();
                let wanted = floor + speed * half;
                if self.least_distance(pair, links) >= wanted.max(self.margin) {
                    continue;
                }
                let distance = self.pair_distance(pair, links);
                if distance < self.margin {
                    return Some(self.contact(pair));
                }
                if distance < wanted {
                    active.push(k);
                }
            }
            let left = active.len();
            if left > end {
                let quarter = 0.5 * half;
                stack.push((middle + quarter, quarter, end, left));
                stack.push((middle - quarter, quarter, end, left));
            }
        }
        None
    }
}
