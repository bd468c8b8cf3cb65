//! What goes in and what comes out.

use scene::{Camera, Features, ImageId, VerifiedPair};

/// An image of a pair.
#[derive(Clone, Copy, Debug)]
pub struct ImageForPair<'a> {
    /// Its id.
    pub id: ImageId,
    /// Its interior orientation; only its size is used when it is not known.
    pub camera: &'a Camera,
    /// The interior orientation is trusted: a calibration, not a guess.
    pub camera_known: bool,
    /// Its features.
    pub features: &'a Features,
}

/// What came of a pair.
#[derive(Clone, Debug, PartialEq)]
pub enum PairVerdict {
    /// Enough matches agree.
    ///
    /// Where both interior orientations are known and the configuration is [`scene::PairConfiguration::Uncalibrated`], the known values
    /// explain clearly fewer matches than a free fundamental matrix: one of them is wrong.
    Verified(VerifiedPair),
    /// The pair shows nothing in common, as far as the matches tell.
    Rejected(Rejection),
}

/// Why a pair was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejection {
    /// There are fewer matches than inliers are wanted.
    FewMatches {
        /// Matches.
        tentative: usize,
    },
    /// Fewer matches agree than are wanted, or no more than would by chance.
    FewInliers {
        /// Matches that agree.
        inliers: usize,
        /// Matches.
        tentative: usize,
    },
    /// What agrees does not move and lies along the border: a part of the vehicle, a caption or the shadow of the lens hood.
    Still {
        /// Matches that do not move.
        still: usize,
        /// Matches.
        tentative: usize,
    },
}
