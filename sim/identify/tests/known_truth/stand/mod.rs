//! The stand that is identified from knocks and multisines, and the motor behind it.

mod blows;
mod impact;
mod motor_on_stand;
mod transfer_function;
