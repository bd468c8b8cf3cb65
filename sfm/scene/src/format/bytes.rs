//! Little-endian reading from memory, with every length checked first.

use super::FormatError;

/// A cursor over the bytes of one file.
pub(super) struct Bytes<'a> {
    file: &'static str,
    data: &'a [u8],
    offset: usize,
}

macro_rules! scalar {
    ($($name:ident: $type:ty),*) => {
        $(pub(super) fn $name(&mut self) -> Result<$type, FormatError> {
            Ok(<$type>::from_le_bytes(self.array()?))
        })*
    };
}

impl<'a> Bytes<'a> {
    pub(super) fn new(file: &'static str, data: &'a [u8]) -> Self {
        Self { file, data, offset: 0 }
    }

    pub(super) fn error(&self, what: impl Into<String>) -> FormatError {
        FormatError::Bytes { file: self.file, offset: self.offset as u64, what: what.into() }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        let rest = &self.data[self.offset..];
        if count > rest.len() {
            return Err(self.error(format!("the file ends here, {count} more bytes were expected")));
        }
        self.offset += count;
        Ok(&rest[..count])
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], FormatError> {
        Ok(self.take(N)?.try_into().expect("take gives exactly N bytes"))
    }

    scalar!(u8: u8, u32: u32, i32: i32, u64: u64, f64: f64);

    pub(super) fn f64s<const N: usize>(&mut self) -> Result<[f64; N], FormatError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// A count of records of at least `min_size` bytes each; what cannot fit into the rest of the file is refused, so
    /// that the caller may reserve memory for it.
    pub(super) fn count(&mut self, count: u64, min_size: usize) -> Result<usize, FormatError> {
        let room = (self.data.len() - self.offset) / min_size;
        match usize::try_from(count) {
            Ok(count) if count <= room => Ok(count),
            _ => Err(self.error(format!("{count} records are announced, the rest of the file holds {room} at most"))),
        }
    }

    /// A string that ends with a zero byte.
    pub(super) fn string(&mut self) -> Result<String, FormatError> {
        let rest = &self.data[self.offset..];
        let Some(length) = rest.iter().position(|&b| b == 0) else {
            return Err(self.error("the name has no end"));
        };
        let bytes = self.take(length + 1)?;
        String::from_utf8(bytes[..length].to_vec()).map_err(|_| self.error("the name is not UTF-8"))
    }

    pub(super) fn end(&self) -> Result<(), FormatError> {
        let left = self.data.len() - self.offset;
        if left > 0 { Err(self.error(format!("{left} bytes too many"))) } else { Ok(()) }
    }
}
