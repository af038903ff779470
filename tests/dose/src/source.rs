//! Source files: ours are consistent, and a bad one is refused with all of its errors.

use stylet_dose::Source;
use stylet_dose::tg43::Formalism;

fn text(name: &str) -> String {
    let file = stylet_test_kit::repository(&format!("sources/{name}.toml"));
    std::fs::read_to_string(file).expect("our sources can be read")
}

fn numbers(table: &toml::Table, section: &str, key: &str) -> Vec<f64> {
    let list = table[section][key].as_array().expect("a list");
    let number = |v: &toml::Value| {
        v.as_float()
            .or_else(|| v.as_integer().map(|i| i as f64))
            .expect("a number")
    };
    list.iter().map(number).collect()
}

/// g_P belongs to the point geometry, g_L to the line geometry; both are printed, so each checks the other.
#[test]
fn the_point_column_follows_from_the_line_column() {
    for (name, allowed) in [("i125_6711", 0.0008), ("pd103_200", 0.0005)] {
        let table: toml::Table = text(name).parse().expect("TOML");
        let source = Source::parse(&text(name)).expect("valid");
        let phi = source.tables.anisotropy_1d.as_ref().expect("there is phi_an");
        let rate = |r_cm: f64| source.tables.rate_gy_per_s(Formalism::OneD, r_cm * 0.01, 0.0) / phi.held(r_cm * 0.01);
        for (r, g_point) in numbers(&table, "radial", "r_cm")
            .into_iter()
            .zip(numbers(&table, "radial", "g_point"))
        {
            let from_line = rate(r) / rate(1.0) * r * r;
            assert!(
                (from_line - g_point).abs() < allowed,
                "{name}, r = {r} cm: {from_line} and {g_point}"
            );
        }
    }
}

/// phi_an is the dose averaged over all directions, relative to that at 90 degrees.
#[test]
fn the_mean_over_directions_of_f_is_phi_an() {
    for (name, allowed) in [("i125_6711", 0.0018), ("i125_iai125a", 0.0001), ("pd103_200", 0.0027)] {
        let source = Source::parse(&text(name)).expect("valid");
        let phi = source.tables.anisotropy_1d.as_ref().expect("there is phi_an");
        for (&r, &printed) in phi.at.iter().zip(&phi.values) {
            let rate = |deg: f64| {
                let (across, along) = deg.to_radians().sin_cos();
                source.tables.rate_gy_per_s(Formalism::TwoD, r * across, r * along)
            };
            let step = 0.05_f64;
            let mean: f64 = (0..1800)
                .map(|i| (i as f64 + 0.5) * step)
                .map(|deg| rate(deg) * deg.to_radians().sin() * step.to_radians())
                .sum::<f64>()
                / rate(90.0);
            assert!((mean - printed).abs() < allowed, "{name}, {r} m: {mean} and {printed}");
        }
    }
}

#[test]
fn every_wrong_value_of_a_file_is_reported_at_once() {
    let bad = text("i125_6711")
        .replace("half_life_days = 59.40", "half_life_days = -3")
        .replace("phi_an = [0.973, ", "phi_an = [")
        .replace("g_line = [1.055, 1.078", "g_line = [1.055, nan")
        .replace("theta_deg = [0, 5", "theta_deg = [5, 5")
        .replace("r0_cm = 1.0", "r0_cm = 2.0");
    let reported = Source::parse(&bad).expect_err("it is bad").to_string();
    println!("{reported}");
    for part in [
        "half_life_days = -3",
        "phi_an has 5",
        "g_line, entry 2 = NaN",
        "theta_deg must rise; 5 is followed by 5",
        "r0_cm = 2",
    ] {
        assert!(reported.contains(part), "{part} is not reported in: {reported}");
    }
}

#[test]
fn files_that_are_no_sources_are_refused() {
    for bad in [
        "",
        "[source]\n",
        "= 1",
        "source = 3\nradial = 4\nanisotropy_1d = [1]\nanisotropy_2d = 1",
        "\u{0}",
    ] {
        assert!(Source::parse(bad).is_err(), "{bad:?} was taken");
    }
    for (of, by, expected) in [
        (
            "dose_rate_constant",
            "dose_rate_constand",
            "unknown field `dose_rate_constand`",
        ),
        ("half_life_days", "# half_life_days", "missing field `half_life_days`"),
        ("g_line = [0.911", "g_line = [\"x\"", "expected f64"),
        ("g_line = ", "# ", "g_line must be a list"),
    ] {
        let why = Source::parse(&text("pd103_200").replace(of, by))
            .expect_err("bad")
            .to_string();
        assert!(why.contains(expected), "{expected}: {why}");
    }
    let swapped = text("pd103_200").replace("g_line = [0.911", "g_line = [nan");
    assert!(Source::parse(&swapped).is_err_and(|e| e.to_string().contains("entry 1")));
}

#[test]
fn without_a_capsule_the_smallest_radius_of_the_table_bounds_the_dose() {
    let without = text("pd103_200")
        .replace("physical_length_cm = 0.45 ", "# ")
        .replace("physical_diameter_cm = 0.081 ", "# ");
    let source = Source::parse(&without).expect("valid");
    let at = |across, along| source.tables.rate_gy_per_s(Formalism::TwoD, across, along);
    assert_eq!(at(0.0, 0.0), at(0.001, 0.0));
    assert!(at(0.0, 0.002115).is_finite());
}
