use super::*;
use bytemuck::Zeroable;
use egui_kittest::kittest::{NodeT, Queryable};
use stylet_host::link::LinkStatus;
use stylet_shm_schema::{Relayed, Text};

fn live() -> Shown {
    let mut shown = Shown::empty("lab");
    shown.status = LinkStatus::Live;
    shown
}

/// Creates a class of an operator who holds the needle, another who asks for it, and an instructor.
fn class() -> Class {
    let mut class = Class {
        count: 3,
        operator: Text::new("Otto"),
        asked: Text::new("Olga"),
        ..Class::zeroed()
    };
    for (member, (name, role)) in
        class
            .members
            .iter_mut()
            .zip([("Otto", OPERATOR), ("Olga", OPERATOR), ("Ina", "instructor")])
    {
        (member.name, member.role) = (Text::new(name), Text::new(role));
    }
    class
}

fn sits(name: &str, role: &str, operates: u32) -> Shown {
    let mut shown = live();
    shown.class = Some(class());
    shown.relayed = Some(Relayed {
        is_heard: 1,
        operates,
        name: Text::new(name),
        role: Text::new(role),
        ..Relayed::zeroed()
    });
    shown
}

/// Returns the buttons of the list.
fn buttons(shown: &Shown) -> Vec<String> {
    let harness = egui_kittest::Harness::new_ui(|ui| {
        list_ui(ui, shown);
    });
    let buttons = harness.query_all_by_role(egui::accesskit::Role::Button);
    buttons.filter_map(|button| button.accesskit_node().label()).collect()
}

#[test]
fn the_holder_sees_requests_and_hands_over_with_one_click() {
    let list = banners(&sits("Otto", OPERATOR, 1));
    assert_eq!(list.len(), 1, "the line has its own banner");
    assert!(list[0].text.contains("Olga asks"), "{}", list[0].text);
    let give = Action::Lease(LeaseRequest::Give("Olga".to_owned()));
    assert_eq!(list[0].remedy, Some(("Hand over", give)));
    assert!(banners(&sits("Olga", OPERATOR, 0)).is_empty(), "it is not hers to give");
}

#[test]
fn only_operators_ask_for_and_get_the_needle() {
    assert_eq!(
        buttons(&sits("Otto", OPERATOR, 1)),
        ["Release the needle", "Hand the needle to Olga"]
    );
    assert_eq!(buttons(&sits("Olga", OPERATOR, 0)), ["Ask for the needle"]);
    assert_eq!(buttons(&sits("Ina", "instructor", 0)), [""; 0]);
}

#[test]
fn the_core_s_window_shows_watchers_and_decides_who_operates() {
    let mut shown = live();
    shown.class = Some(class());
    assert_eq!(buttons(&shown), [""; 0], "a list of another machine");
    if let Some(class) = &mut shown.class {
        class.is_beside_core = 1;
    }
    let list = banners(&shown);
    assert_eq!(
        list[0].text,
        "3 members are connected over the relay. Otto is operating."
    );
    assert_eq!(buttons(&shown), ["Operate from here", "Hand the needle to Olga"]);
}
