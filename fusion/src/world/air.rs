//! Temperature and altitude -> density of the air.
//!
//! `ρ = p / (287.05 T) (1 − 0.378 e/p)`, with the pressure of the ICAO standard atmosphere at the
//! court's altitude and the vapour pressure `e` of half-saturated air (Alduchov & Eskridge 1996).
//! A kelvin is 0.34 %, 1000 m are 11 %: between 20 and 8 °C a shot of 20 m becomes 0.17 m shorter.

/// At 20 °C and sea level, to two digits: what is assumed of a court nothing is known of.
pub const DENSITY_KG_M3: f64 = 1.2;

/// Pressure at sea level.
const SEA_LEVEL_PA: f64 = 101_325.0;

/// Gas constant of dry air, J/(kg K).
const DRY_AIR_J_KG_K: f64 = 287.05;

/// Relative humidity; all of its range is 1 % of density at 30 °C.
const HUMIDITY: f64 = 0.5;

/// Density on a court in this weather.
#[must_use]
pub fn density_kg_m3(temperature_c: f64, altitude_m: f64) -> f64 {
    let pressure_pa = SEA_LEVEL_PA * (1.0 - 2.25577e-5 * altitude_m).powf(5.25588);
    let vapour_pa = HUMIDITY * 610.94 * (17.625 * temperature_c / (temperature_c + 243.04)).exp();
    pressure_pa / (DRY_AIR_J_KG_K * (temperature_c + 273.15))
        * (1.0 - 0.378 * vapour_pa / pressure_pa)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn density_is_that_of_the_tables() {
        // ICAO, dry: 1.225 at 15 °C and 1.112 at 1000 m; half-saturated air is 0.3 % lighter.
        for (temperature_c, altitude_m, expected) in
            [(15.0, 0.0, 1.225), (8.5, 1000.0, 1.112), (30.0, 0.0, 1.164)]
        {
            let density = density_kg_m3(temperature_c, altitude_m);
            assert!((density / expected - 1.0).abs() < 0.01, "{density} for {expected}");
        }
        let per_kelvin = density_kg_m3(21.0, 0.0) / density_kg_m3(20.0, 0.0) - 1.0;
        assert!((-0.0042..-0.0034).contains(&per_kelvin), "{per_kelvin}");
    }
}
