//! A cursor over bytes that never reads past the end.

use thiserror::Error;

/// The bytes are not what they should be.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("not a file of {kind} of this version, or damaged: {detail}")]
pub struct FormatError {
    /// What the file should hold.
    pub kind: &'static str,
    /// What is wrong.
    pub detail: String,
}

pub(super) struct Cursor<'a> {
    kind: &'static str,
    rest: &'a [u8],
}

impl<'a> Cursor<'a> {
    /// Starts behind the magic.
    pub(super) fn new(kind: &'static str, magic: &[u8; 8], bytes: &'a [u8]) -> Result<Self, FormatError> {
        match bytes.strip_prefix(magic) {
            Some(rest) => Ok(Self { kind, rest }),
            None => Err(FormatError { kind, detail: "it starts with other bytes".to_owned() }),
        }
    }

    pub(super) fn error(&self, detail: impl Into<String>) -> FormatError {
        FormatError { kind: self.kind, detail: detail.into() }
    }

    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        let Some((taken, rest)) = self.rest.split_at_checked(count) else {
            return Err(self.error(format!("it ends {} bytes early", count - self.rest.len())));
        };
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], FormatError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub(super) fn u8(&mut self) -> Result<u8, FormatError> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn u32(&mut self) -> Result<u32, FormatError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn f32(&mut self) -> Result<f32, FormatError> {
        let value = f32::from_le_bytes(self.array()?);
        if value.is_finite() { Ok(value) } else { Err(self.error("a number is not finite")) }
    }

    pub(super) fn f64(&mut self) -> Result<f64, FormatError> {
        let value = f64::from_le_bytes(self.array()?);
        if value.is_finite() { Ok(value) } else { Err(self.error("a number is not finite")) }
    }

    /// A number of items of at least `bytes` each that the rest can hold.
    pub(super) fn count(&mut self, bytes: usize) -> Result<usize, FormatError> {
        let count = self.u32()? as usize;
        if count.checked_mul(bytes).is_some_and(|b| b <= self.rest.len()) {
            Ok(count)
        } else {
            Err(self.error(format!("it announces {count} items and ends before")))
        }
    }

    pub(super) fn end(&self) -> Result<(), FormatError> {
        if self.rest.is_empty() { Ok(()) } else { Err(self.error(format!("{} bytes follow its end", self.rest.len()))) }
    }
}
