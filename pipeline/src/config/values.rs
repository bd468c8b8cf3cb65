//! Checks of single values.

use super::error::{Source, did_you_mean};
use super::raw::Place;
use std::ops::Range;
use toml::Spanned;

/// Reads values and notes what is wrong with them; a value that is wrong comes out as its default.
pub(super) struct Values<'s, 'a> {
    pub(super) source: &'s mut Source<'a>,
}

impl Values<'_, '_> {
    pub(super) fn problem(&mut self, at: Range<usize>, key: &str, message: impl Into<String>) {
        self.source.problem(Some(at), key, message, None);
    }

    pub(super) fn problem_with_hint(&mut self, at: Range<usize>, key: &str, message: impl Into<String>, hint: impl Into<String>) {
        self.source.problem(Some(at), key, message, Some(hint.into()));
    }

    /// A finite number, or `None` when absent or wrong.
    pub(super) fn finite(&mut self, key: &str, value: &Place<f64>) -> Option<f64> {
        let value = value.as_ref()?;
        let number = *value.get_ref();
        if number.is_finite() {
            return Some(number);
        }
        self.problem(value.span(), key, format!("must be a finite number, is {number}"));
        None
    }

    /// A finite number above 0, or `None` when absent or wrong.
    pub(super) fn positive(&mut self, key: &str, value: &Place<f64>) -> Option<f64> {
        let number = self.finite(key, value)?;
        if number > 0.0 {
            return Some(number);
        }
        let span = value.as_ref().map_or(0..0, Spanned::span);
        self.problem(span, key, format!("must be above 0, is {number}"));
        None
    }

    /// A number from `low` to `high`, or `default` when absent or wrong.
    pub(super) fn within(&mut self, key: &str, value: &Place<f64>, low: f64, high: f64, default: f64) -> f64 {
        let Some(number) = self.finite(key, value) else { return default };
        if (low..=high).contains(&number) {
            return number;
        }
        let span = value.as_ref().map_or(0..0, Spanned::span);
        self.problem(span, key, format!("must be from {low} to {high}, is {number}"));
        default
    }

    /// A whole number from `low` to `high`, or `default` when absent or wrong.
    pub(super) fn count(&mut self, key: &str, value: &Place<u32>, low: u32, high: u32, default: u32) -> u32 {
        let Some(value) = value else { return default };
        let number = *value.get_ref();
        if (low..=high).contains(&number) {
            return number;
        }
        self.problem(value.span(), key, format!("must be from {low} to {high}, is {number}"));
        default
    }

    /// One of several words, or `None` when absent or wrong.
    pub(super) fn choice<T: Copy>(&mut self, key: &str, value: &Place<String>, choices: &[(&'static str, T)]) -> Option<T> {
        let value = value.as_ref()?;
        let word = value.get_ref();
        if let Some(&(_, choice)) = choices.iter().find(|(name, _)| name == word) {
            return Some(choice);
        }
        let names: Vec<&str> = choices.iter().map(|&(name, _)| name).collect();
        let hint = match did_you_mean(word, names.iter().copied()) {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => format!("one of \"{}\"", names.join("\", \"")),
        };
        self.problem_with_hint(value.span(), key, format!("\"{word}\" is not known"), hint);
        None
    }

    /// Exactly `N` finite numbers, or `None` when absent or wrong.
    pub(super) fn numbers<const N: usize>(&mut self, key: &str, value: &Place<Vec<f64>>) -> Option<[f64; N]> {
        let value = value.as_ref()?;
        let Ok(numbers) = <[f64; N]>::try_from(value.get_ref().as_slice()) else {
            self.problem(value.span(), key, format!("needs {N} numbers, has {}", value.get_ref().len()));
            return None;
        };
        if numbers.iter().all(|n| n.is_finite()) {
            return Some(numbers);
        }
        self.problem(value.span(), key, "must be finite numbers");
        None
    }
}
