//! Context of use: the question that the model answers, for whom, and what it is not for.

/// Heading and text.
pub const CONTEXT: &[(&str, &str)] = &[
    (
        "Question of interest",
        "How does a needle feel and how does the prostate move with it, as seeds are placed in low-dose-rate brachytherapy, so that \
         a trainee can practise and a researcher can compare needles, tissues and plans?",
    ),
    (
        "Context of use",
        "Training and research without a patient, on a PC with a haptic device of up to 8.5 N. The operator feels a force computed \
         1000 times a second from a model of tissue that is solved 200 times a second; the window shows needle, gland and dose.",
    ),
    (
        "Role of the model",
        "The model alone gives force and displacement: there is no measurement of a patient beside it. The dose follows TG-43U1 from \
         the positions of the seeds.",
    ),
    (
        "Model influence",
        "For training: moderate, beside instruction and practice. For research: as high as the study makes it; its author must show \
         that the figures carry the conclusion.",
    ),
    (
        "Consequence of a wrong decision",
        "For the operator's hand: low, because the device and the gate limit the force. For training: a wrong habit. No decision on a \
         patient may rest on Stylet.",
    ),
    (
        "Not for",
        "Planning, delivering or verifying the treatment of a patient. Plans, doses and reports carry this restriction.",
    ),
    (
        "Quantities of interest",
        "Force at the hand along the insertion; depth and force of each puncture; displacement of gland and seeds; D90, V100 and the \
         other metrics of a dose; times of the loops.",
    ),
];
