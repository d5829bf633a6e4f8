//! Pointers from C.

use crate::Status;

/// What a pointer points to.
///
/// # Safety
/// A pointer that is neither NULL nor misaligned points to a `T` that nobody writes meanwhile.
pub(crate) unsafe fn shared<'a, T>(pointer: *const T) -> Result<&'a T, Status> {
    if !pointer.is_aligned() {
        return Err(Status::BadPointer);
    }
    // SAFETY: as of this function. `as_ref` asks for NULL.
    unsafe { pointer.as_ref() }.ok_or(Status::BadPointer)
}

/// So many elements of an array, or an error where there are more than `most`.
///
/// # Safety
/// A pointer that is neither NULL nor misaligned points to `count` elements that nobody writes meanwhile.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, count: usize, most: usize) -> Result<&'a [T], Status> {
    if count == 0 {
        return Err(Status::NoPoints);
    }
    if count > most {
        return Err(Status::TooManyPoints);
    }
    // SAFETY: as of this function.
    unsafe { shared(pointer) }?;
    // SAFETY: as of this function. The size in bytes fits: there are at most `most`.
    Ok(unsafe { core::slice::from_raw_parts(pointer, count) })
}

/// Where a result goes, which may be uninitialized.
///
/// # Safety
/// A pointer that is neither NULL nor misaligned points to memory for a `T` that nobody else uses meanwhile.
pub(crate) unsafe fn out<'a, T>(pointer: *mut T) -> Result<&'a mut core::mem::MaybeUninit<T>, Status> {
    if !pointer.is_aligned() {
        return Err(Status::BadPointer);
    }
    // SAFETY: as of this function. `as_mut` asks for NULL, and this type may be uninitialized.
    unsafe { pointer.cast::<core::mem::MaybeUninit<T>>().as_mut() }.ok_or(Status::BadPointer)
}
