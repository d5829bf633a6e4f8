//! Blind cases for the diagnosis: data with a hidden effect, made by code that shares nothing with the simulator under
//! test (it is no dependency of this crate), and the score of what the diagnosis says of them.
//!
//! - A **case** ([`case`]) is drawn from one seed: a motor after the paper's Table 1 ([`motor`]), what is hidden in it
//!   ([`kind`], [`outside`]), noise ([`noise`]), and the paper's twelve records of 30 s at 1 kHz ([`excitation`]). Its noise
//!   is 0.2 to 5 % of the swing that an amplitude of 0.05 has, each decade as likely as any other. Some laws are bent
//!   ([`shape`]), and some stands add nuisances ([`nuisance`]), which are no effects.
//! - The **data** come from a chain of their own ([`setup`], [`path`], [`chain`], [`lag`]). Every record begins at rest at
//!   its nominal command, and a drift begins with it. Frames lie anywhere, each command takes effect up to 50 us early or
//!   late, and the logger reads up to 20 us early or late; as both are as often early as late, they are no delay.
//! - A **folder** ([`folder`]) has what the tool reads. File names and the order of records are random, and the truth is
//!   in another folder.
//! - The **ceiling** ([`ceiling`], [`fit`], [`likelihood`], [`whiten`], [`solve`]) says what can be identified in a case at all.
//! - The **score** ([`diagnosis`], [`score`], [`tally`], [`report`], [`run`]) compares answers with truths.
//!
//! Seeds: a case's seed is made of its set (`tune` for making the method, `report` for publishing), its class and its
//! number, so that no two cases of any set share one. Effects outside the catalog differ in sort between the sets.
//!
//! Three conventions that the catalog leaves open. The depth of a supply is the slow part of the relative voltage drop at
//! a command of 0.50; a resistance adds up to half as much and is not scored. A drift's change is negative where the
//! thrust falls. A stand's mode passes `(1 - g) + g w^2 / (s^2 + 2 zeta w s + w^2)` of the force, `g` its participation.

pub mod case;
pub mod ceiling;
pub mod chain;
pub mod diagnosis;
pub mod excitation;
pub mod fit;
pub mod folder;
pub mod kind;
pub mod lag;
pub mod likelihood;
pub mod motor;
pub mod noise;
pub mod nuisance;
pub mod outside;
mod parameters;
pub mod path;
pub mod report;
pub mod rotor;
pub mod run;
pub mod scatter;
pub mod score;
pub mod setup;
pub mod shape;
pub mod solve;
pub mod tally;
pub mod whiten;
