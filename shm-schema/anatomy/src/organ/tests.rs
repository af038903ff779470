//! The table against the classifiers that it replaced, each kept here unchanged.

use super::*;

const BOWEL_AND_NERVES: [&str; 8] = [
    "penilebulb",
    "bowel",
    "colonsigmoid",
    "sigmoid",
    "analcanal",
    "canalanal",
    "nvb",
    "neurovascular",
];

/// Names of TG-263, of the built-in scenes, of the fixtures, and as typed by users.
const NAMES: [&str; 62] = [
    "Prostate",
    "prostate",
    "PTV_145",
    "CTV1",
    "GTVp",
    "ITV",
    "ProstateBed",
    "Prostate Bed",
    "gland",
    "capsule",
    "Gland capsule",
    "SemVesicle_L",
    "Seminal Vesicles",
    "Urethra",
    "urethra",
    "Urethra_Prostatc",
    "prostatic urethra",
    "wall of the urethra",
    "Rectum",
    "rectal wall",
    "RectalWall",
    "Wall_Rectum",
    "rectal content",
    "Anorectum",
    "rectum content",
    "Bladder",
    "bladder wall",
    "bladder content",
    "Wall_Bladder",
    "PenileBulb",
    "Bowel_Small",
    "Colon_Sigmoid",
    "Sigmoid",
    "Canal_Anal",
    "Anal canal",
    "NVB_L",
    "NeurovascularBundle",
    "Bone",
    "Femur_Head_L",
    "pubic arch",
    "Symphysis",
    "Pelvis",
    "Sacrum",
    "arch of the pubis",
    "External",
    "BODY",
    "Skin",
    "skin",
    "Muscle",
    "Fat",
    "fat",
    "perineum",
    "Perineum",
    "perineal skin",
    "LevatorAni",
    "label 3",
    "",
    "helper ring",
    "target",
    "my target",
    "Z_PTV",
    "direct",
];

fn begins(name: &str, names: &[&str]) -> bool {
    let plain: String = name
        .to_ascii_lowercase()
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .collect();
    names.iter().any(|n| plain.starts_with(n))
}

/// `files/names.rs`, `known`.
fn by_old_reader(name: &str) -> Option<(Role, Material)> {
    let rows: [(&[&str], Role, Material); 10] = [
        (&["ptv", "ctv", "gtv", "itv"], Role::Target, Material::GLAND),
        (&["prostatebed"], Role::Target, Material::GLAND),
        (&["prostate", "gland"], Role::Target, Material::GLAND),
        (&["semvesicle", "seminalves"], Role::Tissue, Material::GLAND),
        (&["urethra"], Role::Spare, Material::URETHRA),
        (
            &["rectum", "anorectum", "rectalwall", "wallrectum"],
            Role::Spare,
            Material::WALL,
        ),
        (&["bladder"], Role::Spare, Material::WALL),
        (&BOWEL_AND_NERVES, Role::Spare, Material::OTHER),
        (
            &["bone", "femur", "pubic", "symphys", "pelvis", "sacrum"],
            Role::Tissue,
            Material::BONE,
        ),
        (
            &["external", "body", "skin", "muscle", "fat", "perineum", "levator"],
            Role::Tissue,
            Material::OTHER,
        ),
    ];
    let row = rows.iter().find(|(names, ..)| begins(name, names))?;
    Some((row.1, row.2))
}

#[test]
fn rows_stand_in_the_order_of_the_variants() {
    for (place, row) in TABLE.iter().enumerate() {
        assert_eq!(row.organ as usize, place);
    }
}

#[test]
fn readers_get_the_role_and_material_that_they_got() {
    for name in NAMES {
        let now = Organ::of_name(name).map(|o| (o.role(), o.material()));
        assert_eq!(now, by_old_reader(name), "{name}");
    }
}

#[test]
fn dicom_writers_get_the_type_that_they_got() {
    for name in NAMES {
        let before = match by_old_reader(name) {
            Some((Role::Target, _)) => "CTV",
            Some(_) => "ORGAN",
            None => "",
        };
        assert_eq!(Organ::of_name(name).map_or("", Organ::dicom_type), before, "{name}");
    }
}

/// `dose/report.rs`, `metrics`; the dose in the window; `score/dose_cost.rs`, `is_urethra`.
#[test]
fn dose_finds_urethra_and_rectum_where_it_did() {
    for name in NAMES {
        let lower = name.to_lowercase();
        assert_eq!(
            Organ::Urethra.is_mentioned_in(name),
            lower.contains("urethra"),
            "{name}"
        );
        assert_eq!(Organ::Rectum.is_mentioned_in(name), lower.contains("rectum"), "{name}");
        assert_eq!(
            Organ::RectalWall.is_mentioned_in(name),
            lower.contains("rect"),
            "{name}"
        );
    }
}

/// `dose/report.rs`, `choose_target`.
#[test]
fn dose_finds_the_target_where_it_did() {
    let before = |names: &[&str]| {
        let words = ["ptv", "ctv", "prostate", "gland", "gtv", "target"];
        words.iter().find_map(|word| {
            let mentions = |n: &&str| n.to_ascii_lowercase().contains(word);
            names.iter().position(mentions)
        })
    };
    for first in NAMES {
        for second in NAMES {
            assert_eq!(
                target_among(&[first, second]),
                before(&[first, second]),
                "{first}, {second}"
            );
        }
    }
}

/// `view/slice/speckle.rs`, `BY_NAME`: the first of these words that occurs.
#[test]
fn slices_meet_the_words_that_they_met() {
    let words = [
        "content", "urethra", "capsule", "wall", "rect", "bladder", "arch", "bone", "fat", "perineum",
    ];
    for name in NAMES {
        let before = words.into_iter().find(|word| name.to_lowercase().contains(word));
        let part = Part::of_name(name);
        let now = match part {
            Some(Part::Content) => Some("content"),
            _ if Organ::Urethra.is_mentioned_in(name) => Some("urethra"),
            Some(Part::Capsule) => Some("capsule"),
            Some(Part::Wall) => Some("wall"),
            None => [
                (Organ::RectalWall, "rect"),
                (Organ::Bladder, "bladder"),
                (Organ::Bone, "arch"),
                (Organ::Fat, "fat"),
                (Organ::Perineum, "perineum"),
            ]
            .into_iter()
            .find(|(organ, _)| organ.is_mentioned_in(name))
            .map(|(_, word)| word),
        };
        // Arch and bone look alike.
        assert_eq!(
            now,
            before.map(|word| if word == "bone" { "arch" } else { word }),
            "{name}"
        );
    }
}

/// `needle/layers.rs`, `of_structure`. It compared case-sensitively, so the "Skin" of TG-263 was not skin.
#[test]
fn the_needle_feels_skin_where_it_did_and_under_the_name_of_tg_263() {
    let is_skin = |name: &str| Organ::Skin.is_mentioned_in(name) || Organ::Perineum.is_mentioned_in(name);
    for name in NAMES {
        let before = ["skin", "perineum"].iter().any(|word| name.contains(word));
        assert!(is_skin(name) || !before, "{name}");
    }
    assert!(is_skin("Skin") && is_skin("Perineum"));
    assert!(!is_skin("perineal body"));
}

/// "Prostata" was tissue for the readers and not a target for the dose.
#[test]
fn prostata_is_a_target() {
    assert_eq!(Organ::of_name("Prostata").map(Organ::role), Some(Role::Target));
    assert_eq!(target_among(&["Blase", "Prostata"]), Some(1));
    assert_eq!(Organ::of_name("prostatic urethra"), None);
}

/// "Próstata" was tissue, and the urethra had the constraints of an unknown structure.
#[test]
fn names_of_near_languages_are_known_with_and_without_accents() {
    for name in [
        "Próstata",
        "Pro\u{301}stata",
        "PRÓSTATA",
        "Prostaat",
        "Prosztata",
        "Prostate gland",
    ] {
        assert_eq!(Organ::of_name(name), Some(Organ::Prostate), "{name}");
        assert_eq!(target_among(&["Rektum", name]), Some(1), "{name}");
    }
    for name in ["Uretra", "Urètre", "Harnröhre"] {
        assert_eq!(Organ::of_name(name), Some(Organ::Urethra), "{name}");
        assert!(Organ::Urethra.is_mentioned_in(name), "{name}");
    }
    assert!(Organ::Rectum.is_mentioned_in("Rektum") && Organ::RectalWall.is_mentioned_in("Rektum"));
}
