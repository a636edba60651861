//! How far something is → words on stderr, in a line that is written anew.

/// Says each of so many parts of the way once; it hears how far it is, 0 to 1.
pub fn said(n_parts: u32) -> impl FnMut(f64) {
    let mut said = 0;
    move |part| {
        let now = (part * f64::from(n_parts)) as u32;
        if now > said {
            said = now;
            eprint!("\r{:3} %", now * 100 / n_parts);
        }
    }
}
