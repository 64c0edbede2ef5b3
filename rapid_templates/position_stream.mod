MODULE PositionStream
  ! Streams where the robot is while another module moves it, for the columns q1_deg ... q6_deg of a force log: option Externally
  ! Guided Motion, position stream. Moves stay what they are; nothing is guided from outside.
  ! Configuration: Communication, Transmission Protocol: Name ForceLogger, Type UDPUC, Remote Address and Remote Port Number of
  ! the logger. docs/marking.md of compstiff has the wiring, and how to measure the delay.
  VAR egmident streamId;

  PROC StreamOn()
    EGMReset streamId;
    EGMGetId streamId;
    EGMSetupUC ROB_1,streamId,"default","ForceLogger"\Joint;
    EGMStreamStart streamId\SampleRate:=4;
    WaitTime 1;
  ENDPROC

  PROC StreamOff()
    WaitTime 1;
    EGMStreamStop streamId;
    EGMReset streamId;
  ENDPROC

  ! Ten steps to and fro of joint 6, with a stop after each: the edges of its angle in the stream against those of the output
  ! doForceMark in the log of the forces tell the delay. Run it in manual mode, with nothing near the tool.
  PROC StreamTest()
    VAR jointtarget here;
    VAR jointtarget there;
    here:=CJointT();
    there:=here;
    there.robax.rax_6:=here.robax.rax_6-5;
    StreamOn;
    FOR i FROM 1 TO 10 DO
      MoveAbsJ there,v50,fine,tool0;
      SetDO doForceMark,1;
      WaitTime 0.5;
      MoveAbsJ here,v50,fine,tool0;
      SetDO doForceMark,0;
      WaitTime 0.5;
    ENDFOR
    StreamOff;
  ENDPROC
ENDMODULE
