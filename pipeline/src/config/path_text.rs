//! Paths as written, with the values of environment variables in them.

use serde::{Deserialize, Deserializer, de};

/// A path or pattern in which `${NAME}` was replaced by the value of the environment variable NAME.
#[derive(Clone, Debug)]
pub(super) struct PathText {
    path: String,
    /// With the values escaped: what they hold is meant as it stands.
    pattern: String,
}

impl PathText {
    pub(super) fn as_str(&self) -> &str {
        &self.path
    }

    pub(super) fn as_pattern(&self) -> &str {
        &self.pattern
    }
}

impl<'de> Deserialize<'de> for PathText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let written = String::deserialize(deserializer)?;
        let value = |name: &str| std::env::var(name).ok();
        let path = expand(&written, value).map_err(de::Error::custom)?;
        let pattern = expand(&written, |name| value(name).map(|v| glob::Pattern::escape(&v))).map_err(de::Error::custom)?;
        Ok(Self { path, pattern })
    }
}

fn expand(written: &str, value: impl Fn(&str) -> Option<String>) -> Result<String, String> {
    let mut out = String::with_capacity(written.len());
    let mut rest = written;
    while let Some((before, after)) = rest.split_once("${") {
        let (name, after) = after.split_once('}').ok_or_else(|| format!("has `${{` without `}}` in \"{written}\""))?;
        out.push_str(before);
        out.push_str(&value(name).ok_or_else(|| format!("the environment variable {name} is not set"))?);
        rest = after;
    }
    out.push_str(rest);
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_are_replaced_by_their_values() {
        let value = |name: &str| (name == "DATA").then(|| "/srv/data".to_owned());
        assert_eq!(expand("${DATA}/left/*.png", value).unwrap(), "/srv/data/left/*.png");
        assert_eq!(expand("a${DATA}b${DATA}", value).unwrap(), "a/srv/datab/srv/data");
        assert_eq!(expand("masks/{stem}.png, $5", value).unwrap(), "masks/{stem}.png, $5");
        assert!(expand("${DAT}/x", value).unwrap_err().contains("DAT is not set"));
        assert!(expand("${DATA", value).unwrap_err().contains("without `}`"));
    }
}
