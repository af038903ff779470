//! Layout of the window. Parts that appear and disappear do not move anything else.

use super::{App, patch};
use crate::action::Action;
use crate::panel::instructor::instructor_ui;
use crate::panel::parameters::parameters_ui;
use crate::panel::question::question_ui;
use crate::panel::review::review_ui;
use crate::panel::structures::structures_ui;
use crate::panel::trainees::trainees_ui;
use crate::panel::workflow::{Progress, editor_ui, foot_height, foot_ui, run_ui, workflow_ui};
use crate::panel::{banners, class, help, plots, status};
use crate::theme;
use egui::{CentralPanel, Frame, Margin, Panel, Rect, ScrollArea};

/// Smallest useful width of the pictures; below it they share one place with the right panel.
const LEAST_PICTURES: f32 = 420.0;

/// Content of the middle of a narrow window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Narrow {
    #[default]
    Pictures,
    Right,
}

impl App {
    pub(super) fn frame_ui(&mut self, ui: &mut egui::Ui) -> Vec<Action> {
        let mut actions = Vec::new();
        self.workflow.recent.clone_from(&self.settings.recent);
        let [beside, above] = [10_i8, 5];
        let bar = Frame::new()
            .fill(theme::of(ui).panel)
            .inner_margin(Margin::symmetric(beside, above));
        let width = ui.available_width() - 2.0 * f32::from(beside);
        let height = status::status_height(ui, width) + 2.0 * f32::from(above);
        let top = Panel::top("status").exact_size(height).resizable(false);
        top.frame(bar).show(ui, |ui| {
            actions.extend(status::status_ui(ui, &self.shown, &mut self.settings));
        });
        self.left_ui(ui, &mut actions);
        let is_narrow = ui.available_width() < theme::RIGHT_WIDTH + LEAST_PICTURES;
        if is_narrow {
            self.choice_ui(ui);
        } else {
            let right = Panel::right("plots").exact_size(theme::RIGHT_WIDTH).resizable(false);
            right
                .frame(theme::side_panel(ui))
                .show(ui, |ui| self.right_ui(ui, &mut actions));
        }
        let pictures = if is_narrow && self.narrow == Narrow::Right {
            let whole = CentralPanel::default().frame(theme::side_panel(ui));
            whole.show(ui, |ui| self.right_ui(ui, &mut actions)).response.rect
        } else {
            self.middle_ui(ui, &mut actions)
        };
        actions.extend(banners::banners_ui(ui.ctx(), pictures, &banners::banners(&self.shown)));
        parameters_ui(ui.ctx(), &self.shown, &mut self.parameters);
        let table = self.files.structures.as_mut();
        actions.extend(table.and_then(|table| structures_ui(ui.ctx(), &self.shown, table)));
        actions.extend(class::class_ui(ui.ctx(), &self.shown, &mut self.class));
        actions.extend(instructor_ui(
            ui.ctx(),
            &self.shown,
            self.heard.moments(),
            &mut self.instructor,
        ));
        let list = &self.trainees;
        actions.extend(trainees_ui(ui.ctx(), &list.glances, list.followed));
        actions.extend(question_ui(ui.ctx(), &self.shown, self.question.as_ref()));
        help::help_ui(ui.ctx(), &self.shown, &mut self.help);
        if let Some(patch) = &mut self.patch {
            let tip = self.shown.state.map(|s| s.tip_in_scene_m);
            patch::patch_ui(ui.ctx(), patch.take(tip));
        }
        actions
    }

    /// Draws the left panel: the run above and the force below stay in place; the steps between
    /// them scroll.
    fn left_ui(&mut self, ui: &mut egui::Ui, actions: &mut Vec<Action>) {
        let left = Panel::left("workflow").exact_size(theme::LEFT_WIDTH).resizable(false);
        left.frame(theme::side_panel(ui)).show(ui, |ui| {
            let foot = Panel::bottom("foot").exact_size(foot_height(ui)).resizable(false);
            foot.frame(Frame::new())
                .show(ui, |ui| foot_ui(ui, &self.shown, actions));
            run_ui(ui, &self.shown, &mut self.workflow.guide, actions);
            ScrollArea::vertical().show(ui, |ui| {
                actions.extend(workflow_ui(ui, &self.shown, &mut self.workflow));
            });
        });
    }

    /// Draws the right panel: drawing tools on the live picture, needles while a plan is edited,
    /// otherwise the instruments.
    fn right_ui(&mut self, ui: &mut egui::Ui, actions: &mut Vec<Action>) {
        let height = ui.available_height();
        if self.draws() {
            let at_m = self.middle.transverse_at_m(&self.shown);
            ScrollArea::vertical().id_salt("review").show(ui, |ui| {
                actions.extend(review_ui(ui, &self.shown, &mut self.middle.view.tool, at_m));
            });
            return;
        }
        if self.edits_plan() {
            ScrollArea::vertical().id_salt("editor").show(ui, |ui| {
                actions.extend(editor_ui(ui, &self.shown, &mut self.workflow.plan, height));
            });
            return;
        }
        // The debrief covers the whole insertion, not only the last seconds.
        let whole = self.workflow.is_open(Progress::Debrief).then_some(self.heard.trace());
        ScrollArea::vertical().show(ui, |ui| {
            plots::plots_ui(ui, &self.shown, &self.history, self.heard.moments(), whole, height)
        });
    }

    fn choice_ui(&mut self, ui: &mut egui::Ui) {
        let right = match (self.draws(), self.edits_plan()) {
            (true, _) => "Update",
            (false, true) => "Needles",
            (false, false) => "Instruments",
        };
        let strip = Frame::new()
            .fill(theme::of(ui).panel)
            .inner_margin(Margin::symmetric(8, 4));
        let height = ui.spacing().interact_size.y + 8.0;
        Panel::top("choice")
            .exact_size(height)
            .resizable(false)
            .frame(strip)
            .show(ui, |ui| {
                ui.horizontal(|ui| {
                    ui.selectable_value(&mut self.narrow, Narrow::Pictures, "Pictures");
                    ui.selectable_value(&mut self.narrow, Narrow::Right, right);
                });
            });
    }

    fn middle_ui(&mut self, ui: &mut egui::Ui, actions: &mut Vec<Action>) -> Rect {
        let middle = CentralPanel::default().frame(Frame::new());
        let shown = middle.show(ui, |ui| {
            let (layout, dose) = (self.settings.layout, self.shown.dose.as_ref());
            actions.extend(self.middle.middle_ui(ui, layout, &self.shown, dose));
        });
        let mut pictures = shown.response.rect;
        pictures.min.y = self.middle.pictures_top();
        pictures
    }
}
