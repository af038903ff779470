use super::*;
use stylet_dose::decay::Interval;

fn implant(edema: Option<Edema>) -> Implant {
    Implant {
        title: "case <1>".to_owned(),
        source: Source::known("6711").unwrap(),
        prescription_gy: 145.0,
        calibrated: "as of the implant".to_owned(),
        edema,
        is_for_ever: true,
    }
}

/// Returns a cube of seeds in a box, with a urethra and no rectum.
fn state() -> State {
    let seed = |n: usize| Seed {
        position_m: [n % 4, n / 4 % 4, n / 16].map(|i| (i as f64 - 1.5) * 9e-3),
        axis: Some([0.0, 0.0, 1.0]),
        strength_u: 0.4,
    };
    State {
        name: "planned".to_owned(),
        file: "seeds.csv".to_owned(),
        structures_are: "its own outlines".to_owned(),
        seen_s: 0.0,
        seeds: (0..64).map(seed).collect(),
        structures: vec![
            Structure::of_box("Prostate", [-0.016; 3], [0.016; 3], 1e-3),
            Structure::of_box("Urethra", [-0.002, -0.002, -0.016], [0.002, 0.002, 0.016], 0.5e-3),
        ],
        target: 0,
        fit: None,
    }
}

#[test]
fn the_page_has_every_figure_or_its_reason() {
    let edema = Some(Edema::of_days(0.5, 9.3));
    let implant = implant(edema);
    let kernel = DoseKernel::new(&implant.source, Interval::ALL);
    let columns = [
        Column::of(&implant, &kernel, state(), None),
        Column::of(&implant, &kernel, state(), edema),
    ];
    let rows = rows(&implant, &columns);
    let value = |group: &str, name: &str, column: usize| {
        let row = rows.iter().find(|r| r.group == group && r.name == name).unwrap();
        row.values[column].clone()
    };
    for name in ["D100", "D90", "V90", "V100", "V150", "V200"] {
        assert!(value("target", name, 0).is_ok(), "{name}");
    }
    assert!((value("implant", "strength over target volume", 0).unwrap() / (25.6 / 32.768) - 1.0).abs() < 1e-9);
    assert!(value("urethra", "D10", 0).unwrap() > value("urethra", "D30", 0).unwrap());
    assert_eq!(
        value("rectum", "D2cc", 0).unwrap_err().to_string(),
        "no structure is called rectum"
    );
    let (v100, v150) = (value("target", "V100", 0).unwrap(), value("target", "V150", 0).unwrap());
    assert!((value("indices", "homogeneity", 0).unwrap() - (v100 - v150) / v100).abs() < 1e-9);
    assert!((0.3..1.0).contains(&value("indices", "conformity", 0).unwrap()));
    // Seen swollen on day 0, the gland gets more once it has shrunk.
    assert!(value("target", "D90", 1).unwrap() > 1.05 * value("target", "D90", 0).unwrap());
    assert!(value("effect", "BED of target D90", 1).is_err());
    let page = page(&implant, &columns).unwrap();
    let histograms = &page[page
        .find("Dose-volume histograms: planned, edema solid, planned dashed")
        .unwrap()..];
    assert!(histograms.contains("<svg") && histograms.contains("urethra") && !histograms.contains(">rectum<"));
    assert!(page.contains("@page{size:A4 portrait") && page.contains("case &lt;1&gt;"));
    assert!(page.contains("not computed: no structure is called rectum"));
    // Guards against the same sentence in seven cells, which made every other column as wide.
    let edema_s = "not computed: with edema the dose rate does not decay with the source alone";
    assert_eq!(page.matches(edema_s).count(), 1, "{page}");
    assert!(page.contains("–<sup>1</sup>") && page.contains("–<sup>2</sup>"));
    assert_eq!(columns[0].sectors.len(), 12);
    let json = to_json(&implant, &columns);
    assert!(json["states"][0]["figures"]["target D90 [Gy]"].as_f64().unwrap() > 100.0);
    assert!(json["states"][1]["figures"]["effect BED of target D90 [Gy]"]["not_computed"].is_string());
}

/// Guards against a page of `pelvis`, which draws the wall alone, without a rectum, although the
/// plan kept its limit.
#[test]
fn the_rectal_wall_replaces_a_missing_rectum() {
    let (implant, at) = (implant(None), |low: f64| {
        ([-0.01, low, -0.016], [0.01, low + 0.004, 0.016])
    });
    let kernel = DoseKernel::new(&implant.source, Interval::ALL);
    let d2cc = |names: &[(&str, f64)]| {
        let mut state = state();
        for (name, low) in names {
            let (low, high) = at(*low);
            state.structures.push(Structure::of_box(name, low, high, 1e-3));
        }
        let columns = [Column::of(&implant, &kernel, state, None)];
        let rows = rows(&implant, &columns);
        let row = rows.iter().find(|r| r.group == "rectum" && r.name == "D2cc").unwrap();
        row.values[0].clone().unwrap()
    };
    let wall = d2cc(&[("rectal wall", -0.024)]);
    assert_eq!(wall, d2cc(&[("Rectum", -0.024)]));
    // A drawn rectum counts, in any order.
    assert_eq!(wall, d2cc(&[("rectal wall", -0.03), ("Rectum", -0.024)]));
}
