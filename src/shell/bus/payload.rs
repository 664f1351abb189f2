//! What comes over the network as bytes, without copying where it lies in one piece, as in shared memory.

use bytes::Bytes;
use zenoh::bytes::ZBytes;

/// The bytes.
#[must_use]
pub fn bytes_of(payload: &ZBytes) -> Bytes {
    if payload.slices().count() == 1 {
        Bytes::from_owner(Piece(payload.clone()))
    } else {
        payload.to_bytes().into_owned().into()
    }
}

/// A payload in one piece.
struct Piece(ZBytes);

impl AsRef<[u8]> for Piece {
    fn as_ref(&self) -> &[u8] {
        self.0.slices().next().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_one_piece_or_in_many_they_are_the_same() {
        let mut writer = ZBytes::writer();
        writer.append(ZBytes::from(vec![1, 2]));
        writer.append(ZBytes::from(vec![3]));
        assert_eq!(bytes_of(&writer.finish()), Bytes::from_static(&[1, 2, 3]));
        assert_eq!(bytes_of(&ZBytes::from(vec![1, 2, 3])), Bytes::from_static(&[1, 2, 3]));
        assert!(bytes_of(&ZBytes::new()).is_empty());
    }
}
