//! Interleaved samples taken apart into their bands, which is what makes arithmetic on colours wide.

/// Pixels at a time: enough that a loop over them takes whole registers, and their bands stay in the fastest cache.
pub(super) const PIXELS: usize = 256;

/// Samples of that many pixels of three bands.
pub(super) const SAMPLES: usize = 3 * PIXELS;

/// The bands of a block. Plain loops that write where they stand: compilers know to shuffle whole registers for these, and do it for
/// little else (closures that make arrays take two and a half times as long).
#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
pub(super) fn bands(block: &[u8; SAMPLES]) -> [[u8; PIXELS]; 3] {
    let [mut first, mut second, mut third] = [[0; PIXELS]; 3];
    for i in 0..PIXELS {
        first[i] = block[3 * i];
        second[i] = block[3 * i + 1];
        third[i] = block[3 * i + 2];
    }
    [first, second, third]
}

/// A row block by block: whole ones as they stand, and what is left in one filled up with zeros. `write` has the samples of a block and
/// where its pixels go.
#[expect(clippy::inline_always, reason = "only inside its callers can it be compiled for their registers")]
#[inline(always)]
pub(super) fn each_block(row: &[u8], out: &mut [u8], mut write: impl FnMut(&[u8; SAMPLES], &mut [u8; PIXELS])) {
    let (blocks, rest) = row.as_chunks::<SAMPLES>();
    let (out_blocks, out_rest) = out.as_chunks_mut::<PIXELS>();
    for (block, out) in blocks.iter().zip(out_blocks) {
        write(block, out);
    }
    if !rest.is_empty() {
        let (mut block, mut filled) = ([0; SAMPLES], [0; PIXELS]);
        block[..rest.len()].copy_from_slice(rest);
        write(&block, &mut filled);
        out_rest.copy_from_slice(&filled[..out_rest.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_any_length_come_out_pixel_by_pixel() {
        for pixels in [0, 1, PIXELS - 1, PIXELS, 2 * PIXELS + 7] {
            let row: Vec<u8> = (0..3 * pixels).map(|i| ((i * 7919) >> 3).to_le_bytes()[0]).collect();
            let mut out = vec![0; pixels];
            each_block(&row, &mut out, |block, out| {
                let [a, b, c] = bands(block);
                for i in 0..PIXELS {
                    out[i] = a[i].wrapping_add(b[i].wrapping_mul(3)).wrapping_add(c[i].wrapping_mul(5));
                }
            });
            let slow = row.as_chunks::<3>().0.iter();
            let slow = slow.map(|[a, b, c]| a.wrapping_add(b.wrapping_mul(3)).wrapping_add(c.wrapping_mul(5)));
            assert_eq!(out, slow.collect::<Vec<_>>(), "{pixels}");
        }
    }
}
