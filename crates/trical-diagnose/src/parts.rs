//! The joint fit of everything that was chosen, in parts: what the fit to the others says of each, in errors and in log scores of blocks of
//! neighbouring poses, and what disjoint parts say of the same coefficients.

use std::sync::OnceLock;

use trical_ident::folds::{FOLDS, Folds};
use trical_ident::identify::ErrorSummary;

use crate::linear::{Alone, Design, Partition};
use crate::probability::{Replication, replication};
use crate::settings::{LAST_PERCENT, PARTS_BY_ROWS};

/// The joint fit of a set of candidates in parts.
pub(crate) struct Parts<'a> {
    partition: Partition<'a>,
    /// The only part that is scored, if not all are.
    scored: Option<usize>,
    block_of_row: Vec<usize>,
    blocks: usize,
    /// Of a row that the fit did not see.
    variance: f64,
    temper: f64,
    /// The joint fit to parts alone, from when it is first asked for.
    alone: OnceLock<Vec<Alone>>,
}

impl<'a> Parts<'a> {
    /// Four parts that cut no block.
    pub(crate) fn by_block(design: &'a Design, set: &[usize], folds: &Folds, temper: f64) -> Option<Self> {
        let fold_of_block = folds.fold_of_blocks(FOLDS);
        let part_of = |pose: usize| fold_of_block.get(folds.block_of(pose)).copied().unwrap_or(0);
        Self::new(design, set, folds, temper, (FOLDS, None, &part_of))
    }

    /// Four parts, every fourth pose in each.
    pub(crate) fn by_pose(design: &'a Design, set: &[usize], folds: &Folds, temper: f64) -> Option<Self> {
        let part_of = |pose: usize| folds.poses().binary_search(&pose).unwrap_or(0) % FOLDS;
        Self::new(design, set, folds, temper, (FOLDS, None, &part_of))
    }

    /// The last quarter of each session's poses, by those before.
    pub(crate) fn forward(design: &'a Design, set: &[usize], folds: &Folds, temper: f64) -> Option<Self> {
        let split = folds.forward(LAST_PERCENT)?;
        Self::new(design, set, folds, temper, (2, Some(0), &|pose| usize::from(!split(pose))))
    }

    fn new(
        design: &'a Design,
        set: &[usize],
        folds: &Folds,
        temper: f64,
        (count, scored, part_of): (usize, Option<usize>, &dyn Fn(usize) -> usize),
    ) -> Option<Self> {
        let partition = Partition::new(design, set, count, part_of)?;
        let block_of_row = partition.pose_of_row().iter().map(|pose| folds.block_of(*pose)).collect();
        let seen: Vec<f64> = partition.instead(&[], None).into_iter().filter(|r| r.is_finite()).collect();
        #[expect(clippy::cast_precision_loss, reason = "a count")]
        let variance = seen.iter().map(|r| r * r).sum::<f64>() / seen.len().max(1) as f64;
        let blocks = folds.blocks();
        let alone = OnceLock::new();
        (variance > 0.0).then_some(Self { partition, scored, block_of_row, blocks, variance, temper, alone })
    }

    /// Log score of each block without the candidates `out` and with `add` in their place.
    pub(crate) fn scores(&self, out: &[usize], add: Option<usize>) -> Vec<f64> {
        let mut scores = vec![0.0; self.blocks];
        for (r, block) in self.partition.instead(out, add).iter().zip(&self.block_of_row) {
            // a fit that failed predicts nothing: as bad as can be
            let square = if r.is_finite() { r * r } else { 1e6 * self.variance };
            scores[*block] -= 0.5 * self.temper * square / self.variance;
        }
        scores
    }

    /// Position errors without the candidates `out` and with `add` in their place, each by the fit to the other parts.
    pub(crate) fn errors(&self, out: &[usize], add: Option<usize>) -> ErrorSummary {
        ErrorSummary::of(&self.partition.position_errors(&self.partition.instead(out, add), self.scored))
    }

    /// Coefficients of some members from disjoint parts, compared: from each of four parts, or from halves where a part has few rows
    /// beside its parameters.
    pub(crate) fn replication(&self, members: &[usize], parameters: usize) -> Replication {
        let alone = self.alone.get_or_init(|| {
            let least = self.partition.sizes().into_iter().min().unwrap_or(0);
            let groups: Vec<Vec<usize>> = if least >= PARTS_BY_ROWS * parameters {
                (0..FOLDS).map(|k| vec![k]).collect()
            } else {
                vec![(0..FOLDS / 2).collect(), (FOLDS / 2..FOLDS).collect()]
            };
            self.partition.alone(&groups)
        });
        replication(&self.partition.apart(members, alone), self.variance / self.temper)
    }
}
