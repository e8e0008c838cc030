//! The frame of saved bytes: what they are, of which format, and a digest that finds damage.
//!
//! ```text
//! mark (8 bytes) | format (2, little-endian) | SHA-256 of mark, format and content (32) | content (postcard)
//! ```

use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::error::NavError;

/// Number of the format; a change of anything that is saved raises it (the test in `navigator/saved_tests.rs` notices).
pub(crate) const FORMAT: u16 = 30;

const FORMAT_AT: usize = 8;
const DIGEST_AT: usize = FORMAT_AT + 2;
pub(crate) const CONTENT_AT: usize = DIGEST_AT + 32;

/// What bytes hold: their mark, and its name in messages.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kind {
    pub(crate) mark: [u8; FORMAT_AT],
    pub(crate) name: &'static str,
}

impl Kind {
    fn refusal(&self, fault: impl Into<String>) -> NavError {
        NavError::NotRestored {
            what: self.name,
            fault: fault.into(),
        }
    }

    /// The bytes of a value.
    ///
    /// # Errors
    /// [`NavError::NotRestored`] for a value that postcard cannot write, which none of ours is.
    pub(crate) fn seal<T: Serialize>(&self, value: &T) -> Result<Vec<u8>, NavError> {
        let content = postcard::to_stdvec(value).map_err(|error| self.refusal(error.to_string()))?;
        Ok(self.frame(&content))
    }

    /// The frame around a content.
    pub(crate) fn frame(&self, content: &[u8]) -> Vec<u8> {
        let format = FORMAT.to_le_bytes();
        let digest = self.digest(format, content);
        [&self.mark[..], &format, &digest, content].concat()
    }

    /// The value of bytes that [`Kind::seal`] made.
    ///
    /// # Errors
    /// [`NavError::NotRestored`] for bytes of another kind or format, and for damaged ones.
    pub(crate) fn open<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T, NavError> {
        if !bytes.starts_with(&self.mark) {
            return Err(self.refusal("the bytes begin otherwise, expected those that its save() returned"));
        }
        let Some((head, content)) = bytes.split_at_checked(CONTENT_AT) else {
            return Err(self.refusal(format!("{} bytes are too few: they were cut short", bytes.len())));
        };
        let format = [head[FORMAT_AT], head[FORMAT_AT + 1]];
        if format != FORMAT.to_le_bytes() {
            let found = u16::from_le_bytes(format);
            return Err(self.refusal(format!(
                "format {found}, expected {FORMAT}: another version of bottomlock saved it"
            )));
        }
        if head[DIGEST_AT..] != self.digest(format, content) {
            return Err(self.refusal("the digest differs: the bytes are damaged or were cut short"));
        }
        let other = "the content has another layout: another version of bottomlock saved it";
        match postcard::take_from_bytes(content) {
            Ok((value, [])) => Ok(value),
            _ => Err(self.refusal(other)),
        }
    }

    fn digest(&self, format: [u8; 2], content: &[u8]) -> [u8; 32] {
        let mut digest = Sha256::new();
        digest.update(self.mark);
        digest.update(format);
        digest.update(content);
        digest.finalize().into()
    }
}
