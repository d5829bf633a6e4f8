//! How stacks write parameters down.

use super::super::Parameter;
use super::Stack;
use super::text::digits;

/// The syntax of a stack.
pub(super) struct Syntax {
    /// What a file of it ends with.
    pub(super) extension: &'static str,
    /// What a comment begins with, its further lines, and its end.
    comment: [&'static str; 3],
    /// Name, value and motors as a line.
    line: fn(&str, &str, u8) -> String,
    frame: Frame,
}

/// What stands around the lines.
#[derive(Default)]
struct Frame {
    open: &'static str,
    close: &'static str,
    /// Before each line.
    indent: &'static str,
    /// Whether the lines are attributes of one element, in which no comment may stand.
    is_element: bool,
}

/// Columns of a comment.
const WIDTH: usize = 110;

const SCRIPT: [&str; 3] = ["# ", "# ", ""];
const XML: [&str; 3] = ["<!-- ", "     ", " -->"];

impl Syntax {
    /// Paragraphs as one comment.
    pub(super) fn comment(&self, paragraphs: &[String]) -> String {
        let [begin, next, end] = self.comment;
        // A comment of XML holds no double hyphen: options are named without, and names of files are spaced.
        let plain = |words: &String| match self.comment == XML {
            true => words.replace("`--", "option `").replace(" --", " option ").replace("--", "- -"),
            false => words.clone(),
        };
        let paragraphs: Vec<String> = paragraphs.iter().map(plain).collect();
        let lines: Vec<_> = paragraphs.iter().flat_map(|words| textwrap::wrap(words, WIDTH)).collect();
        format!("{begin}{}{end}\n", lines.join(&format!("\n{next}")))
    }

    /// Parameters, each with its comment.
    pub(super) fn parameters(&self, parameters: &[(Vec<String>, &Parameter)], motors: u8) -> String {
        let Frame { open, close, indent, is_element } = self.frame;
        let comments = parameters.iter().map(|(about, _)| self.comment(about));
        let lines = parameters.iter().map(|(_, parameter)| self.line(parameter, motors));
        if is_element {
            let lines = lines.collect::<Vec<_>>().join(" ");
            return format!("{}\n{open}{lines}{close}\n", comments.collect::<Vec<_>>().join("\n"));
        }
        let blocks: Vec<String> = comments.zip(lines).map(|(comment, line)| format!("{comment}{line}\n")).collect();
        let body = textwrap::indent(&blocks.join("\n"), indent);
        [open, &body, close].concat()
    }

    fn line(&self, parameter: &Parameter, motors: u8) -> String {
        let (name, value) = (parameter.definition.name, digits(parameter.value));
        let Some(written) = parameter.definition.written else { return (self.line)(name, &value, motors) };
        let end = |end: Option<f64>| end.map_or_else(|| value.clone(), digits);
        [
            ("{name}", name.to_owned()),
            ("{value}", value.clone()),
            ("{low}", end(parameter.low)),
            ("{high}", end(parameter.high)),
        ]
        .into_iter()
        .fold(written.to_owned(), |line, (place, text)| line.replace(place, &text))
    }

    pub(super) fn for_stack(stack: Stack) -> Self {
        let script = |line| Self { extension: "txt", comment: SCRIPT, line, frame: Frame::default() };
        let xml = |line| Self { extension: "xml", comment: XML, line, frame: Frame::default() };
        let is = |extension, frame, line| Self { extension, frame, ..script(line) };
        match stack {
            Stack::Betaflight => script(|name, value, _| format!("set {name} = {value}")),
            Stack::Px4 | Stack::Px4Sih => script(|name, value, _| format!("param set {name} {value}")),
            Stack::Ardupilot => is("param", Frame::default(), |name, value, _| format!("{name},{value}")),
            Stack::Paparazzi => xml(|name, value, motors| {
                format!("<define name=\"{name}\" value=\"{{{}}}\"/>", repeat_for_motors(value, motors, ", "))
            }),
            Stack::Indiflight => {
                script(|name, value, motors| format!("set {name} = {}", repeat_for_motors(value, motors, ",")))
            }
            Stack::Gazebo => xml(|name, value, _| format!("<{name}>{value}</{name}>")),
            Stack::IsaacLab => is("py", ISAAC_LAB, |name, value, _| format!("{name}={value},")),
            Stack::AerialGym => is("py", AERIAL_GYM, |name, value, _| format!("{name} = {value}")),
            Stack::Crazyflow => is("toml", Frame::default(), |name, value, _| format!("{name} = {value}")),
            Stack::Rotorpy => is("py", ROTORPY, |name, value, _| format!("\"{name}\": {value},")),
            Stack::GymPybulletDrones => Self { frame: PROPERTIES, ..xml(attribute) },
            Stack::Mujoco => Self { frame: ACTUATOR, ..xml(attribute) },
            Stack::Flightmare => is("yaml", FLIGHTMARE, |name, value, _| format!("{name}: {value}")),
        }
    }
}

const ISAAC_LAB: Frame = Frame {
    open: "from isaaclab_contrib.actuators import ThrusterCfg\n\nTHRUSTER = ThrusterCfg(\n",
    close: "\n    use_discrete_approximation=False,\n    integration_scheme=\"rk4\",\n)\n",
    indent: "    ",
    is_element: false,
};
const AERIAL_GYM: Frame = Frame {
    open: "class motor_model_config:\n",
    close: "\n    use_rps = True\n    use_discrete_approximation = True\n    integration_scheme = \"rk4\"\n",
    indent: "    ",
    is_element: false,
};
const ROTORPY: Frame = Frame { open: "quad_params = {\n", close: "}\n", indent: "    ", is_element: false };
const FLIGHTMARE: Frame = Frame { open: "quadrotor_dynamics:\n", close: "", indent: "  ", is_element: false };
const PROPERTIES: Frame = Frame { open: "<properties ", close: "/>", indent: "", is_element: true };
const ACTUATOR: Frame = Frame {
    open: "<general dyntype=\"filterexact\" gaintype=\"fixed\" biastype=\"none\" ctrlrange=\"0 1\" actrange=\"0 1\" actearly=\"true\" ",
    close: "/>",
    indent: "",
    is_element: true,
};

fn attribute(name: &str, value: &str, _motors: u8) -> String {
    format!("{name}=\"{value}\"")
}

fn repeat_for_motors(value: &str, motors: u8, separator: &str) -> String {
    vec![value; usize::from(motors)].join(separator)
}
