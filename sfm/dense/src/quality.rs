//! How much of the image resolution is used.

/// Working resolution of dense matching.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quality {
    /// Long side of 640 pixels.
    Low,
    /// Long side of 960 pixels.
    #[default]
    Medium,
    /// Long side of 1920 pixels.
    High,
}

impl Quality {
    /// Every level.
    pub const ALL: [Self; 3] = [Self::Low, Self::Medium, Self::High];

    /// The name used in configuration files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Low => "low",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }

    /// The level of a name used in configuration files.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.name() == name)
    }

    /// Largest length of the long side, pixels.
    #[must_use]
    pub fn long_side(self) -> u32 {
        match self {
            Self::Low => 640,
            Self::Medium => 960,
            Self::High => 1920,
        }
    }

    /// Size to which an image of `width` x `height` is reduced: the long side becomes [`Quality::long_side`], the short one
    /// keeps the aspect, rounded to the nearest pixel and at least 1. Smaller images stay as they are.
    #[must_use]
    pub fn working_size(self, width: u32, height: u32) -> (u32, u32) {
        fit(width, height, self.long_side())
    }
}

/// The size of the same aspect whose long side is at most `long_side`, see [`Quality::working_size`].
#[must_use]
pub fn fit(width: u32, height: u32, long_side: u32) -> (u32, u32) {
    let long = width.max(height);
    if long <= long_side {
        return (width, height);
    }
    let scale = |side: u32| {
        let scaled = (u64::from(side) * u64::from(long_side) * 2 + u64::from(long)) / (2 * u64::from(long));
        u32::try_from(scaled).unwrap_or(long_side).max(1)
    };
    (scale(width), scale(height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_keep_the_aspect_and_never_grow() {
        assert_eq!(Quality::Medium.working_size(1920, 1080), (960, 540));
        assert_eq!(Quality::Low.working_size(1024, 1360), (482, 640));
        assert_eq!(Quality::High.working_size(1360, 1024), (1360, 1024));
        assert_eq!(Quality::Low.working_size(100_000, 3), (640, 1));
        assert_eq!(fit(0, 0, 640), (0, 0));
    }

    #[test]
    fn names_round_trip() {
        for quality in Quality::ALL {
            assert_eq!(Quality::from_name(quality.name()), Some(quality));
        }
        assert_eq!(Quality::from_name("ultra"), None);
    }
}
