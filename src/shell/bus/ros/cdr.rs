//! CDR as ROS 2 sends it: four bytes that tell the byte order, then the fields one after the other, each at a multiple of its size (XCDR1,
//! OMG DDSI-RTPS 2.5, 10.2, and DDS-XTypes 1.3, 7.4.1). Read in both byte orders, written in little-endian.

/// What is wrong with a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CdrError {
    /// Shorter than what tells the byte order.
    #[error("a message of {bytes} bytes: not even the 4 that tell how it is written")]
    NoHeader {
        /// Its length.
        bytes: usize,
    },
    /// Written in another way.
    #[error("encapsulation {kind:#06x}: CDR in big-endian (0x0000) or little-endian (0x0001) is read")]
    Encapsulation {
        /// What the message says.
        kind: u16,
    },
    /// It ends too early.
    #[error("the message ends at byte {end}, where {needed} bytes from {at} on are needed")]
    Truncated {
        /// Place of what is read, after the header.
        at: usize,
        /// Its size.
        needed: usize,
        /// Where the message ends.
        end: usize,
    },
    /// A text that is none.
    #[error("the text at byte {at} does not end with a zero byte, or is not UTF-8")]
    NotText {
        /// Its place, after the header.
        at: usize,
    },
    /// More follows than padding: the message is of another type.
    #[error("{bytes} bytes follow where the message ends: it is of another type")]
    Left {
        /// How many.
        bytes: usize,
    },
}

/// Padding that may follow the last field.
const MOST_PADDING: usize = 3;

/// Reads field after field. Nothing is set aside that is not there: a sequence that says it is longer than the message is refused.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    body: &'a [u8],
    at: usize,
    is_little: bool,
}

impl<'a> Reader<'a> {
    /// Of a message.
    ///
    /// # Errors
    /// No header, or one of another encapsulation.
    pub fn new(message: &'a [u8]) -> Result<Self, CdrError> {
        let Some(([kind_high, kind_low, _, _], body)) = message.split_first_chunk::<4>() else {
            return Err(CdrError::NoHeader { bytes: message.len() });
        };
        let kind = u16::from_be_bytes([*kind_high, *kind_low]);
        match kind {
            0 | 1 => Ok(Self { body, at: 0, is_little: kind == 1 }),
            kind => Err(CdrError::Encapsulation { kind }),
        }
    }

    fn bytes(&mut self, alignment: usize, count: usize) -> Result<&'a [u8], CdrError> {
        let at = self.at.next_multiple_of(alignment);
        let found = at.checked_add(count).and_then(|end| self.body.get(at..end));
        let Some(found) = found else {
            return Err(CdrError::Truncated { at, needed: count, end: self.body.len() });
        };
        self.at = at + count;
        Ok(found)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], CdrError> {
        let mut value = [0; N];
        value.copy_from_slice(self.bytes(N, N)?);
        if !self.is_little {
            value.reverse();
        }
        Ok(value)
    }

    /// A `bool`: any byte but zero is true.
    ///
    /// # Errors
    /// If the message ends before.
    pub fn bool(&mut self) -> Result<bool, CdrError> {
        Ok(self.array::<1>()? != [0])
    }

    /// A `uint32`.
    ///
    /// # Errors
    /// If the message ends before.
    pub fn u32(&mut self) -> Result<u32, CdrError> {
        self.array().map(u32::from_le_bytes)
    }

    /// An `int32`.
    ///
    /// # Errors
    /// If the message ends before.
    pub fn i32(&mut self) -> Result<i32, CdrError> {
        self.array().map(i32::from_le_bytes)
    }

    /// A `float64`.
    ///
    /// # Errors
    /// If the message ends before.
    pub fn f64(&mut self) -> Result<f64, CdrError> {
        self.array().map(f64::from_le_bytes)
    }

    /// A `float64[N]`.
    ///
    /// # Errors
    /// If the message ends before.
    pub fn f64s<const N: usize>(&mut self) -> Result<[f64; N], CdrError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// A `float64[]`.
    ///
    /// # Errors
    /// If the message ends before.
    pub fn f64_sequence(&mut self) -> Result<Vec<f64>, CdrError> {
        let count = self.length()?;
        let needed = count.saturating_mul(8);
        if needed > self.body.len().saturating_sub(self.at) {
            return Err(CdrError::Truncated { at: self.at, needed, end: self.body.len() });
        }
        (0..count).map(|_| self.f64()).collect()
    }

    /// A `uint8[]`, without copying it.
    ///
    /// # Errors
    /// If the message ends before.
    pub fn byte_sequence(&mut self) -> Result<&'a [u8], CdrError> {
        let count = self.length()?;
        self.bytes(1, count)
    }

    /// A `string`.
    ///
    /// # Errors
    /// If the message ends before; no text.
    pub fn string(&mut self) -> Result<&'a str, CdrError> {
        let count = self.length()?;
        let at = self.at;
        let bytes = self.bytes(1, count)?;
        // Its length counts the zero byte; an empty text has been seen without.
        let text = if bytes.is_empty() { bytes } else { bytes.strip_suffix(&[0]).ok_or(CdrError::NotText { at })? };
        std::str::from_utf8(text).map_err(|_| CdrError::NotText { at })
    }

    fn length(&mut self) -> Result<usize, CdrError> {
        // On any machine that this runs on.
        self.u32().map(|length| usize::try_from(length).unwrap_or(usize::MAX))
    }

    /// That the message ends here.
    ///
    /// # Errors
    /// If more than padding follows.
    pub const fn end(&self) -> Result<(), CdrError> {
        let bytes = self.body.len().saturating_sub(self.at);
        if bytes > MOST_PADDING { Err(CdrError::Left { bytes }) } else { Ok(()) }
    }
}

/// Writes field after field, little-endian.
#[derive(Clone, Debug)]
pub struct Writer {
    message: Vec<u8>,
}

impl Default for Writer {
    fn default() -> Self {
        Self { message: vec![0, 1, 0, 0] }
    }
}

impl Writer {
    fn put(&mut self, alignment: usize, bytes: &[u8]) {
        // The header counts for nothing, and has a size at which 8 begins anew.
        let body = self.message.len() - 4;
        self.message.resize(4 + body.next_multiple_of(alignment), 0);
        self.message.extend_from_slice(bytes);
    }

    /// A `uint32`.
    pub fn u32(&mut self, value: u32) {
        self.put(4, &value.to_le_bytes());
    }

    /// An `int32`.
    pub fn i32(&mut self, value: i32) {
        self.put(4, &value.to_le_bytes());
    }

    /// `float64`s one after the other, without their number.
    pub fn f64s(&mut self, values: &[f64]) {
        for value in values {
            self.put(8, &value.to_le_bytes());
        }
    }

    /// A `string`; what follows a zero byte in it is left out.
    pub fn string(&mut self, text: &str) {
        let text = text.split('\0').next().unwrap_or_default();
        self.u32(u32::try_from(text.len() + 1).unwrap_or(u32::MAX));
        self.put(1, text.as_bytes());
        self.put(1, &[0]);
    }

    /// The message.
    #[must_use]
    pub fn finish(self) -> Vec<u8> {
        self.message
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn fields_stand_at_multiples_of_their_size_counted_after_the_header() {
        let mut writer = Writer::default();
        writer.string("ab");
        writer.f64s(&[1.0]);
        writer.i32(-2);
        let message = writer.finish();
        let expected = [
            &[0, 1, 0, 0][..],
            &[3, 0, 0, 0, b'a', b'b', 0, 0],
            &[0, 0, 0, 0, 0, 0, 0xf0, 0x3f],
            &[0xfe, 0xff, 0xff, 0xff],
        ];
        assert_eq!(message, expected.concat());
        let mut reader = Reader::new(&message).expect("a header");
        assert_eq!((reader.string(), reader.f64(), reader.i32()), (Ok("ab"), Ok(1.0), Ok(-2)));
        assert_eq!(reader.end(), Ok(()));
    }

    #[test]
    fn both_byte_orders_are_read() {
        let big = [0, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 0x3f, 0xf0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, b'x', 0];
        let mut reader = Reader::new(&big).expect("a header");
        assert_eq!((reader.u32(), reader.f64(), reader.string()), (Ok(258), Ok(1.0), Ok("x")));
    }

    #[test]
    fn what_says_that_it_is_longer_than_it_is_is_refused_before_anything_is_set_aside() {
        let liar = [0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 1, 2, 3];
        let reader = || Reader::new(&liar).expect("a header");
        assert!(matches!(reader().string(), Err(CdrError::Truncated { at: 4, end: 7, .. })));
        assert!(matches!(reader().byte_sequence(), Err(CdrError::Truncated { .. })));
        assert!(matches!(reader().f64_sequence(), Err(CdrError::Truncated { .. })));
        assert_eq!(Reader::new(&[0, 1, 0]).err(), Some(CdrError::NoHeader { bytes: 3 }));
        assert_eq!(Reader::new(&[0, 7, 0, 0]).err(), Some(CdrError::Encapsulation { kind: 7 }));
        let no_end = [0, 1, 0, 0, 2, 0, 0, 0, b'a', b'b'];
        assert_eq!(Reader::new(&no_end).expect("a header").string(), Err(CdrError::NotText { at: 4 }));
        assert_eq!(Reader::new(&liar).expect("a header").end(), Err(CdrError::Left { bytes: 7 }));
    }

    proptest! {
        #[test]
        fn texts_and_numbers_come_back(text in "[^\\x00]{0,40}", numbers in proptest::collection::vec(any::<f64>(), 0..9)) {
            let mut writer = Writer::default();
            writer.string(&text);
            writer.u32(u32::try_from(numbers.len()).expect("few"));
            writer.f64s(&numbers);
            let message = writer.finish();
            let mut reader = Reader::new(&message).expect("a header");
            prop_assert_eq!(reader.string(), Ok(text.as_str()));
            let found = reader.f64_sequence().expect("numbers");
            prop_assert!(found.iter().map(|x| x.to_bits()).eq(numbers.iter().map(|x| x.to_bits())));
            prop_assert_eq!(reader.end(), Ok(()));
        }
    }
}
