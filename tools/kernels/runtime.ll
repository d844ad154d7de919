; What compiled code may call on any platform, so that a library of kernels needs no other library.

define hidden ptr @memset(ptr returned %to, i32 %value, i64 %size) #0 {
start:
  %byte = trunc i32 %value to i8
  %none = icmp eq i64 %size, 0
  br i1 %none, label %end, label %loop
loop:
  %i = phi i64 [ 0, %start ], [ %next, %loop ]
  %place = getelementptr inbounds i8, ptr %to, i64 %i
  store i8 %byte, ptr %place, align 1
  %next = add nuw i64 %i, 1
  %done = icmp eq i64 %next, %size
  br i1 %done, label %end, label %loop
end:
  ret ptr %to
}

define hidden ptr @memcpy(ptr returned %to, ptr %from, i64 %size) #0 {
  %same = call ptr @memmove(ptr %to, ptr %from, i64 %size)
  ret ptr %to
}

define hidden ptr @memmove(ptr returned %to, ptr %from, i64 %size) #0 {
start:
  %none = icmp eq i64 %size, 0
  br i1 %none, label %end, label %begin
begin:
  %backwards = icmp ult ptr %from, %to
  br i1 %backwards, label %down, label %up
up:
  %i = phi i64 [ 0, %begin ], [ %i1, %up ]
  %up_from = getelementptr inbounds i8, ptr %from, i64 %i
  %up_to = getelementptr inbounds i8, ptr %to, i64 %i
  %up_byte = load i8, ptr %up_from, align 1
  store i8 %up_byte, ptr %up_to, align 1
  %i1 = add nuw i64 %i, 1
  %up_done = icmp eq i64 %i1, %size
  br i1 %up_done, label %end, label %up
down:
  %j = phi i64 [ %size, %begin ], [ %j1, %down ]
  %j1 = add i64 %j, -1
  %down_from = getelementptr inbounds i8, ptr %from, i64 %j1
  %down_to = getelementptr inbounds i8, ptr %to, i64 %j1
  %down_byte = load i8, ptr %down_from, align 1
  store i8 %down_byte, ptr %down_to, align 1
  %down_done = icmp eq i64 %j1, 0
  br i1 %down_done, label %end, label %down
end:
  ret ptr %to
}

define hidden double @floor(double %x) #0 {
  %whole = call double @whole(double %x)
  %above = fcmp ogt double %whole, %x
  %less = fsub double %whole, 1.0
  %out = select i1 %above, double %less, double %whole
  ret double %out
}

define hidden double @ceil(double %x) #0 {
  %whole = call double @whole(double %x)
  %below = fcmp olt double %whole, %x
  %more = fadd double %whole, 1.0
  %out = select i1 %below, double %more, double %whole
  ret double %out
}

; Towards zero; numbers from 2**52 on, infinite ones and NaN are whole.
define internal double @whole(double %x) #0 {
  %bits = bitcast double %x to i64
  %size = and i64 %bits, 9223372036854775807
  %small = icmp ult i64 %size, 4841369599423283200
  br i1 %small, label %cut, label %as_it_is
cut:
  %integer = fptosi double %x to i64
  %out = sitofp i64 %integer to double
  ret double %out
as_it_is:
  ret double %x
}

attributes #0 = { nounwind "no-builtins" }
